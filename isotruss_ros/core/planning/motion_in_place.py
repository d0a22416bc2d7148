# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Motion in place: the squeeze of a held object changes while its pose stays.

The object is held and the contacts roll, by the mechanics of the elastic plant. Newton steps of
the rollers, by exact derivatives of the equilibrium, bring squeeze and place to what is wanted.
"""

from __future__ import annotations

import math

from isotruss_ros.core.errors import ConfigurationError, GraspError
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.held_gradient import held_gradient
from isotruss_ros.core.holding.held_grip import HeldGrip, NotHeldError
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.holding.settle_grasp import MAX_DISPLACEMENT
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.limits import stack_rows
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.pose import pose_difference
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.qp import QuadraticProgram, solve_qp
from isotruss_ros.core.planning.closing import Closing, evaluate_state
from isotruss_ros.core.planning.violations import RequirementError
import numpy as np

#: Newton steps with which a waypoint is brought to its squeeze and place ...
MAX_CORRECTIONS = 12
#: ... until the squeeze is right to this share, the place to this length [m], the angle [rad] ...
SQUEEZE_TOLERANCE, PLACE_TOLERANCE, TURN_TOLERANCE = 1e-3, 2e-5, 1e-4
#: ... and each of three members presses as hard as balances without friction, to this share.
EVEN_TOLERANCE = 0.02
#: What counts most where the rollers cannot do all: x, y, angle, and evenness, in tolerances ...
WEIGHTS = np.array([1.0, 1.0, 0.05, 10.0, 10.0, 10.0])
#: ... against the rollers' motion [1/m^2].
MOTION_WEIGHT = 2e4
#: What takes long ways of the rollers is left: a step that leaves more than this share of it [-].
SLOW = 0.7


def hold_between(config: Configuration, closing: Closing) -> HeldGrip:
    """
    Return how the members of a grip hold its object; from here on contacts roll.

    :param config: in which they press on it.
    :param closing: the grip.
    :raises RequirementError: they do not hold it, or another member presses too.
    :raises StructureError: see `structure_of`.
    """
    try:
        members = np.array(closing.members)
        held = attach_grip(config, closing.body, members, tubes=closing.tubes)
        grasp = roll_grip(held, config)
    except NotHeldError:
        grasp = None
    if grasp is None or len(grasp.members) != len(closing.members):
        raise RequirementError('held', 0.0, 1.0)
    return grasp


def squeeze_in_place(grasp: HeldGrip, force: float, closing: Closing) -> HeldGrip:
    """
    Return a grasp with another squeeze, the object where it lay.

    :param grasp: how the object is held, from `roll_grip`.
    :param force: mean normal force of the members, positive [N].
    :param closing: the grip, where the object is to stay, and the bounds of the motion.
    :raises RequirementError: what ends the motion before.
    :raises StructureError: see `structure_of`.
    """
    evened = len(closing.members) if len(closing.members) > 2 else 0
    scale = np.array(
        [SQUEEZE_TOLERANCE * force, PLACE_TOLERANCE, PLACE_TOLERANCE, TURN_TOLERANCE]
        + evened * [EVEN_TOLERANCE * force]
    )
    weights = WEIGHTS[: len(scale) - 1]
    limits = stack_rows(grasp.config, closing.limits)
    rows = np.concatenate([limits.matrix, -limits.matrix])
    room = np.concatenate([limits.upper, -limits.lower])  # until where the motion ends
    rollers = len(grasp.config.roller_positions)
    for _ in range(MAX_CORRECTIONS):
        # Errors count in tolerances: of squeeze, pose and, of three members, evenness.
        missing = _missing(grasp, force, closing.body) / scale
        try:
            held = held_gradient(grasp)
        except GraspError:
            break
        pose, forces = held.pose[:, :rollers], held.normal_forces[:, :rollers]
        rates = np.vstack([forces.mean(axis=0), pose, forces])[: len(scale)] / scale[:, None]
        others = weights[:, None] * rates[1:]
        # The motion brings the squeeze, and of the rest what it can.
        travel = solve_qp(
            QuadraticProgram(
                others.T @ others + MOTION_WEIGHT * np.eye(others.shape[1]),
                -others.T @ (weights * missing[1:]),
                rows,
                room,
                equality=rates[:1],
                target=missing[:1],
            )
        )
        if travel is None:
            break
        room = room - rows @ travel
        gain = rates @ travel
        errors = [np.linalg.norm(weights * each[1:]) for each in (missing, missing - gain)]
        if abs(missing[0]) < 1.0 and (np.abs(gain).max() < 1.0 or errors[1] > SLOW * errors[0]):
            _check_place(grasp, closing)
            return grasp
        closing.tally.evaluations += 1
        try:
            config = grasp.config.moved_to(grasp.config.roller_positions + travel)
        except ConfigurationError:
            raise RequirementError('rigidity', 0.0, closing.min_rigidity) from None
        moved = roll_grip(grasp, config)
        if moved is None or len(moved.members) != len(grasp.members):
            raise RequirementError('held', 0.0, 1.0)
        grasp = moved
    raise RequirementError('squeeze', grasp.squeeze, force)


def _missing(grasp: HeldGrip, force: float, body: ConvexObject) -> Array:
    """Return what a grip lacks of a squeeze [N], a pose [m, rad] and, of three members, forces."""
    missing = np.append(force - grasp.squeeze, pose_difference(body.pose, grasp.pose))
    owners = grasp.contacts.owners
    if owners[-1] < 2:
        return missing
    # Three members press in such shares of the total that their forces balance.
    normals = grasp.state.normals[np.searchsorted(owners, np.arange(3))]
    shares = (np.roll(normals, -1).conj() * np.roll(normals, -2)).imag
    return np.append(missing, 3.0 * force * shares / shares.sum() - grasp.normal_forces)


def _check_place(grasp: HeldGrip, closing: Closing) -> None:
    """Raise unless a grip keeps the bounds, and the object in place, as far as rollers can."""
    state = evaluate_state(grasp.config, grasp.body)
    least = np.zeros(len(state.gaps))
    least[list(closing.members)] = -np.inf
    state.check_bounds(closing.min_rigidity, 0.0, least)
    # A robot of few rollers cannot close and keep the object in place: it goes along a little.
    bound = MAX_DISPLACEMENT * grasp.config.robot.description.tube_diameter
    distance = math.hypot(*pose_difference(grasp.pose, closing.body.pose)[:2])
    if distance > bound:
        raise RequirementError('in_place', distance, bound)
