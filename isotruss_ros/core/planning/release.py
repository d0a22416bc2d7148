# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Release of a held object: unload it in place, open the grip, retreat.

While the members still press, the squeeze falls and the object stays where it is; where it is all
but zero they move away from it, which then stands still.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
import math

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.grip_record import GripRecord
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.depths import member_depths
from isotruss_ros.core.manipulation.grip import find_members, Grip
from isotruss_ros.core.manipulation.limits import MemberLengthLimit
from isotruss_ros.core.manipulation.solve_twist import solve_twist
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.planning.closing import BOUND_SHARE, Closing
from isotruss_ros.core.planning.closing_step import press
from isotruss_ros.core.planning.motion_in_place import hold_between, squeeze_in_place
from isotruss_ros.core.planning.requirements import MIN_RIGIDITY
from isotruss_ros.core.planning.violations import RequirementError, Violation
import numpy as np

#: Shares of the squeeze at the waypoints of the unloading; at the last the members let go. What
#: still presses there moves the object by its share of the deflection.
UNLOADING_SHARES = (0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.04, 0.015, 0.005, 0.002)
#: Smallest normal force of a pressing member [N].
MIN_CONTACT_FORCE = 0.01
#: Members that are no deeper in the object than this only touch it, and by so much a grip opens in
#: place before its members move away, as shares of the tube's diameter.
TOUCHING, FIRST_OPENING = 1e-3, 0.015
#: Number of waypoints of the retreat [-].
OPENING_STEPS = 5
#: A command that limits scale down by more than this is not followed.
MIN_SCALE = 0.999


@dataclass(frozen=True, eq=False)
class Release:
    """Path of a release, or the violation."""

    path: Array  #: (k, r) roller positions from the present ones [m]; none with a violation
    apart: int  #: the row of `path` from which on nothing touches the object
    violation: Violation | None = None  #: what ends the motion; None if nothing does
    turned: float = 0.0  #: by the model, as the grip opens [rad]


@single_threaded
def plan_release(
    config: Configuration,
    body: ConvexObject,
    members: Sequence[str],
    clearance: float,
    record: GripRecord | None = None,
    max_turn: float = math.inf,
) -> Release:
    """
    Plan the release of a held object and the retreat.

    :param config: configuration of the robot.
    :param body: the object, where it was measured.
    :param members: names `t/j-k` of the two members, or three, that hold it.
    :param clearance: gap of each of these at the end, positive, at most as long as all tubes
        together [m].
    :param record: how the loop that holds the object has it; if None, or where that is no
        equilibrium, the object is held as it would be with unknown contact history.
    :param max_turn: a path on which the object turns by more in the model is none [rad].
    :raises GraspError: no such members, or a clearance out of range.
    :raises ConfigurationError: the shape in which the grip opens is singular.
    :raises SolverError: a quadratic program was not solved.
    :raises StructureError: see `structure_of`.
    """
    file = config.robot.description
    longest = float(config.member_lengths.sum())
    if not 0.0 < clearance <= longest:
        raise GraspError(
            f'clearance {clearance:.6g} m: must be positive, at most {longest:.6g} m, as long as '
            'all tubes together'
        )
    numbers = find_members(config.robot, Grip(tuple(members), body).members).members
    limit = MemberLengthLimit(file.min_length, file.max_length, BOUND_SHARE)
    held = None if record is None else record.restore(config, body)
    if held is not None:  # in the model, whose members the path opens
        body = held.body
    closing = Closing(body, tuple(numbers.tolist()), (limit,), MIN_RIGIDITY)
    try:
        path, closing = _unload(config, closing, held)
        turned = math.remainder(closing.body.pose.angle - body.pose.angle, 2.0 * math.pi)
        if abs(turned) > max_turn:
            raise RequirementError('turned', abs(turned), max_turn)
        apart = len(path) - 1 if len(path) > 1 else 1
        for gap in np.linspace(0.0, clearance, OPENING_STEPS + 1)[1:]:
            path.append(press(path[-1], closing, np.full(len(closing.members), -gap)))
    except RequirementError as error:
        return Release(np.empty((0, len(config.roller_positions))), 0, Violation(*error.args))
    return Release(np.array([where.roller_positions for where in path]), apart, turned=turned)


def _unload(
    config: Configuration, closing: Closing, held: HeldGrip | None
) -> tuple[list[Configuration], Closing]:
    """
    Return the path of decreasing squeeze; its start only without contact forces.

    Also where the object is at its end, as a grip of few rollers takes it along a little.
    """
    path, diameter = [config], config.robot.description.tube_diameter
    if float(member_depths(config, closing.body).max()) <= TOUCHING * diameter:
        return path, closing
    grasp = hold_between(config, closing) if held is None else held
    if grasp.normal_forces.min() <= MIN_CONTACT_FORCE:
        return path, closing
    for force in grasp.squeeze * np.array(UNLOADING_SHARES):
        grasp = squeeze_in_place(grasp, force, closing)
        path.append(grasp.config)
    # In place: members that merely moved away would roll the object along as they touch it yet.
    grip, config = grasp.touching(closing.body.friction_or(None)), grasp.config
    opening = FIRST_OPENING * diameter
    command = solve_twist(config, grip, np.zeros(3), limits=closing.limits, opening_rate=opening)
    if command.scale < MIN_SCALE:
        raise RequirementError('squeeze', grasp.squeeze, 0.0)
    path.append(config.moved_to(config.roller_positions + command.roller_velocities))
    return path, replace(closing, body=grasp.body)
