# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Motion in place: the squeeze of a free object is changed without moving the object.

Two members have force closure from the first contact on. Then the rollers move such that the
squeeze increases while the object keeps its pose. The roller travel for the desired squeeze and
pose is found by Newton's method, with rolling contacts, elastic tubes and exact derivatives of the
equilibrium. A motion computed for a fixed object would displace a free object by several
centimetres.
"""

from __future__ import annotations

from collections.abc import Iterator
import math

from isotruss_ros.core.chance.probability import find_chance
from isotruss_ros.core.chance.uncertainty import Uncertainty
from isotruss_ros.core.errors import ConfigurationError, GraspError
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.grasp_gradient import held_gradient
from isotruss_ros.core.holding.held_grip import HeldGrip, HoldStatus, NotHeldError
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.parameter_deviations import Chance
from isotruss_ros.core.model.pose import pose_difference
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.qp import QuadraticProgram, solve_qp
from isotruss_ros.core.numerics.tolerances import MAX_SEARCH_STEPS
from isotruss_ros.core.planning.approach import Closing, evaluate_state, FIRST_INDENTATION, press
from isotruss_ros.core.planning.facing import CONE_SHARE
from isotruss_ros.core.planning.grasp_plan import ClosedGrip
from isotruss_ros.core.planning.violations import RequirementError, Violation
import numpy as np

#: Relative tolerance of the squeeze, and of the forces of three members compared with those of a
#: balance without friction [-].
SQUEEZE_TOLERANCE = 1e-3
#: Smallest ratio of the squeeze to the required squeeze [-].
MIN_SQUEEZE_SHARE = 1.0 - 2.0 * SQUEEZE_TOLERANCE
#: Tolerance of the pose, with rotations times the characteristic radius [m].
PLACE_TOLERANCE = 2e-5
#: Weight of the rotation relative to the other residuals in units of their tolerances, if not all
#: residuals can vanish [-].
ROTATION_WEIGHT = 0.05
#: Largest displacement of the object due to a change of the squeeze, in tube diameters [-]; a
#: robot with few rollers cannot avoid a displacement.
MAX_SHIFT = 0.25
#: Weight of squared roller travel relative to squared residuals [1/m^2].
MOTION_WEIGHT = 2e4
#: Largest decrease of the squeeze in an iteration relative to the squeeze [-]. With 0.5 the
#: release of one box in three needs too many iterations, with 1 that by three members loses
#: contact.
MAX_FALL = 0.8
#: Largest ratio of the residuals of successive steps [-]; slower convergence ends the iteration.
MAX_CONTRACTION = 0.7
#: Decrease of the distance between the members from waypoint to waypoint, in tube diameters [-].
CLOSING_STEP = 0.12
#: Factor by which the increments are reduced after the first violation of a bound [-]; the second
#: violation ends the closing.
REFINEMENT = 0.34


def hold_between(config: Configuration, closing: Closing) -> HeldGrip:
    """Return the equilibrium of an object between the closing members, with rolling contacts."""
    try:
        attached = attach_grip(config, closing.body, closing.members)
    except NotHeldError:
        raise RequirementError('held', 0.0, 1.0) from None
    return roll_between(attached, config, closing)


def roll_between(grasp: HeldGrip, config: Configuration, closing: Closing) -> HeldGrip:
    """Return the grasp rolled to a configuration; raise RequirementError if contact is lost."""
    rolled = roll_grip(grasp, config)
    if rolled is None or len(rolled.members) != len(closing.members):
        raise RequirementError('held', 0.0, 1.0)
    return rolled


def squeeze_in_place(grasp: HeldGrip, force: float, closing: Closing) -> HeldGrip:
    """Return the grasp with this mean normal force [N] and an unchanged pose of the object."""
    rows, room = closing.limit.rows(grasp.config).one_sided()  # up to the end of the motion
    rollers = len(grasp.config.roller_positions)

    # Gauss-Newton method on the errors of squeeze, pose and forces, relative to their tolerances.
    for _ in range(MAX_SEARCH_STEPS):
        errors, tolerances = _find_errors(grasp, force, closing.body)
        errors /= tolerances
        try:
            gradient = held_gradient(grasp)
        except GraspError:
            break
        pose_rates, force_rates = gradient.pose[:, :rollers], gradient.normal_forces[:, :rollers]
        rates = np.vstack([force_rates.mean(axis=0), pose_rates, force_rates])[: len(errors)]
        rates = rates / tolerances[:, None]

        # The travel u minimises |W (errors - rates u)|^2 + MOTION_WEIGHT |u|^2 at this squeeze.
        weights = np.ones(len(errors) - 1)
        weights[2] = ROTATION_WEIGHT  # after x and y
        matrix, residuals = weights[:, None] * rates[1:], weights * errors[1:]
        hessian = matrix.T @ matrix + MOTION_WEIGHT * np.eye(rollers)
        linear = -matrix.T @ residuals
        travel = solve_qp(QuadraticProgram(hessian, linear, rows, room, rates[:1], errors[:1]))
        if travel is None:
            break
        room = room - rows @ travel

        # The method ends at the squeeze if a step decreases the errors only a little.
        is_small = np.abs(rates @ travel).max() < 1.0
        next_size = np.linalg.norm(residuals - matrix @ travel)
        is_slow = next_size > MAX_CONTRACTION * np.linalg.norm(residuals)
        if (is_small or is_slow) and abs(errors[0]) < 1.0:
            _check_in_place(grasp, closing)
            return grasp
        closing.tally.evaluations += 1
        try:
            config = grasp.config.moved_to(grasp.config.roller_positions + travel)
        except ConfigurationError:
            raise RequirementError('rigidity', 0.0, closing.needs.min_rigidity) from None
        grasp = roll_between(grasp, config, closing)
    raise RequirementError('squeeze', grasp.squeeze, force)


def _check_in_place(grasp: HeldGrip, closing: Closing) -> None:
    """Raise RequirementError if the object is displaced, or rigidity or a gap is too small."""
    needs = closing.needs
    state = evaluate_state(grasp.config, grasp.body, needs, grasp.touching(needs.friction))
    min_gaps = np.zeros(len(state.gaps))
    min_gaps[closing.members] = -np.inf
    state.check_bounds(needs.min_rigidity, 0.0, min_gaps, needs.min_obstacle_clearance)
    bound = MAX_SHIFT * grasp.config.robot.description.tube_diameter
    displacement = math.hypot(*pose_difference(grasp.pose, closing.body.pose)[:2])
    if displacement > bound:
        raise RequirementError('in_place', displacement, bound)


def _find_errors(grasp: HeldGrip, force: float, body: ConvexObject) -> tuple[Array, Array]:
    """Return the errors, desired minus actual, of squeeze, pose and forces, and tolerances."""
    rise = max(force - grasp.squeeze, -MAX_FALL * grasp.squeeze)
    errors = np.append(rise, pose_difference(body.pose, grasp.pose))
    force_tolerance = SQUEEZE_TOLERANCE * force
    tolerances = np.append(force_tolerance, PLACE_TOLERANCE / np.array([1.0, 1.0, grasp.arm]))
    if len(grasp.members) < 3:
        return errors, tolerances
    # Three forces balance without friction if each is proportional to the sine of the angle
    # between the other two.
    normals = grasp.state.normals[grasp.contacts.member_starts]
    sines = (np.roll(normals, -1).conj() * np.roll(normals, -2)).imag
    force_errors = 3.0 * force * sines / sines.sum() - grasp.normal_forces
    return np.append(errors, force_errors), np.append(tolerances, 3 * [force_tolerance])


def close_in_place(start: Configuration, closing: Closing) -> Iterator[ClosedGrip]:
    """Yield grips with increasing squeeze, from first contact until a requirement is violated."""
    needs, diameter = closing.needs, start.robot.description.tube_diameter
    # A grip may use a part of the friction angle while it closes.
    usable_friction = math.tan(CONE_SHARE * math.atan(needs.friction))
    depths = np.full(len(closing.members), FIRST_INDENTATION * diameter)
    grasp = _require_hold(hold_between(press(start, closing, depths), closing), usable_friction)
    # A grip of two members is assessed after the first step, which moves the object to its pose.
    if len(closing.members) > 2:
        with closing.tally.recording():
            yield _judge(grasp, closing)
    # Increments of the squeeze; they are refined after the first violation of a requirement.
    step_share, max_squeeze = 1.0, needs.squeeze or math.inf
    while step_share >= REFINEMENT and grasp.squeeze < MIN_SQUEEZE_SHARE * max_squeeze:
        rise = -CLOSING_STEP * diameter * grasp.squeeze_stiffness()
        force = min(grasp.squeeze + step_share * rise, max_squeeze)
        try:
            moved = _require_hold(squeeze_in_place(grasp, force, closing), usable_friction)
            yield _judge(moved, closing)
            grasp = moved
        except RequirementError as error:
            closing.tally.record(Violation(*error.args))
            step_share *= REFINEMENT


def _judge(grasp: HeldGrip, closing: Closing) -> ClosedGrip:
    """
    Return a closed grip with its slip margin; raise RequirementError if its forces are too large.

    Slip margin and chance, under the required wrench, are None if more squeeze is needed.
    """
    needs, forces = closing.needs, grasp.normal_forces
    closing.tally.analyses += 1
    needs.check_bounds(max_contact_force=forces.max(), max_total_force=forces.sum())
    needs.check_bounds(max_utilisation=grasp.sections.used.max())
    if grasp.squeeze < MIN_SQUEEZE_SHARE * (needs.squeeze or 0.0):
        return ClosedGrip(grasp, slip_margin=None)
    try:
        loaded, chance = grasp, None
        if any(needs.external_wrench):
            rolled = roll_grip(grasp, grasp.config, np.array(needs.external_wrench))
            loaded = _require_hold(rolled, needs.friction)
        slip_margin = loaded.slip_margin(needs.friction)
        needs.check_bounds(min_slip_margin=slip_margin)
        if closing.uncertainty is not None:
            chance = _find_chance(grasp, loaded, closing.uncertainty, needs.friction)
    except RequirementError as error:  # more squeeze may mend it
        closing.tally.record(Violation(*error.args))
        return ClosedGrip(grasp, slip_margin=None)
    return ClosedGrip(grasp, slip_margin, chance)


def _require_hold(grasp: HeldGrip | None, friction: float) -> HeldGrip:
    """Return the grasp; raise RequirementError if there is none, or if a contact slips."""
    hold = HoldStatus.NO_BALANCE if grasp is None else grasp.hold(friction)
    if hold is HoldStatus.SLIPS:
        raise RequirementError('force_closure', grasp.required_friction, friction)
    if hold is not HoldStatus.HELD:
        raise RequirementError('held', 0.0, 1.0)
    return grasp


def _find_chance(
    grasp: HeldGrip, loaded: HeldGrip, uncertainty: Uncertainty, friction: float
) -> Chance:
    """Return the chance that a grasp holds an object both without and with external load."""
    try:
        unloaded = attach_grip(grasp.config, grasp.body, grasp.members)
        grips = [unloaded] if loaded is grasp else [unloaded, loaded]
        mean = uncertainty.mean_friction(friction)
        return find_chance(grips, mean, uncertainty.covariance(loaded))
    except GraspError:
        raise RequirementError('held', 0.0, 1.0) from None
