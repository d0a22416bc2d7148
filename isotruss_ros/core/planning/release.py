# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Release of a held object: unloading without motion, opening of the grip, and retreat.

The squeeze is decreased while the object keeps its pose. When the squeeze is negligible, the
members move away from the object.
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
from isotruss_ros.core.manipulation.grip import check_member_names, find_members
from isotruss_ros.core.manipulation.limits import MemberLengthLimit
from isotruss_ros.core.manipulation.solve_twist import solve_twist
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.obstacle import Obstacle
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.numerics.tolerances import ROUNDING
from isotruss_ros.core.planning.approach import (
    BOUND_SHARE,
    Closing,
    FIRST_INDENTATION,
    GAP_TOLERANCE,
    press,
)
from isotruss_ros.core.planning.motion_in_place import hold_between, roll_between, squeeze_in_place
from isotruss_ros.core.planning.requirements import GraspRequirements
from isotruss_ros.core.planning.violations import RequirementError, Violation
import numpy as np

#: Number of steps of the unloading [-]. Of 64 discs, ellipses, boxes and hexagons the median is
#: displaced by 0.13 mm on the way, with 2 steps by 0.8 mm. None slips; with 2 or 15 steps one
#: does.
UNLOADING_STEPS = 5


@dataclass(frozen=True, eq=False)
class Release:
    """Path that releases an object, or the requirement that prevents the release."""

    #: (k, r) roller positions, beginning at the current positions [m]; empty if there is a
    #: violation
    path: Array
    apart: int  #: index of the first row of `path` in which no member touches the object
    violation: Violation | None = None  #: violated requirement; None if the release is possible


@single_threaded
def plan_release(
    config: Configuration,
    body: ConvexObject,
    members: Sequence[str],
    clearance: float,
    record: GripRecord | None = None,
    max_turn: float = math.inf,
    obstacles: Sequence[Obstacle] = (),
) -> Release:
    """
    Plan the release of a held object and the retreat of the members to a clearance [m].

    The `record` of the loop that holds the object replaces the equilibrium of `attach_grip`; the
    predicted rotation of the object is at most `max_turn` [rad]. The robot keeps the clearance of
    `GraspRequirements` from obstacles.
    """
    description = config.robot.description
    longest = float(config.member_lengths.sum())
    if not 0.0 < clearance <= longest:
        raise GraspError(
            f'clearance {clearance:.6g} m: must be positive, at most {longest:.6g} m, as long as '
            'all tubes together'
        )
    names = check_member_names(members)
    indices = find_members(config.robot.topology, names).members
    limit = MemberLengthLimit(description.min_length, description.max_length, BOUND_SHARE)
    held = None if record is None else record.restore(config, body)
    body = body if held is None else held.body  # the pose in the model
    closing = Closing(body, indices, limit, GraspRequirements(obstacles=tuple(obstacles)))
    try:
        path, closing = _unload(config, closing, held)
        turn = abs(math.remainder(closing.body.pose.angle - body.pose.angle, 2.0 * math.pi))
        if turn > max_turn:
            raise RequirementError('turned', turn, max_turn)
        first_apart = max(len(path) - 1, 1)  # the row with the open grip, or the first retreat
        for gap in np.linspace(clearance / 5, clearance, 5):
            path.append(press(path[-1], closing, np.full(len(closing.members), -gap)))
    except RequirementError as error:
        return Release(np.empty((0, len(config.roller_positions))), 0, Violation(*error.args))
    return Release(np.array([waypoint.roller_positions for waypoint in path]), first_apart)


def _unload(
    config: Configuration, closing: Closing, held: HeldGrip | None
) -> tuple[list[Configuration], Closing]:
    """
    Return the path of decreasing squeeze, and `closing` with the object at its pose at the end.

    Without contact forces the path consists of its start only.
    """
    path, diameter = [config], config.robot.description.tube_diameter
    if float(member_depths(config, closing.body).max()) <= FIRST_INDENTATION * diameter:
        return path, closing
    grasp = hold_between(config, closing) if held is None else held
    if grasp.normal_forces.min() <= 0.0:  # a member without contact force
        return path, closing
    # Unloading. On the straight line to a grip almost without forces, all contact forces decrease
    # in proportion; so the waypoints are near this line. On the shortest way to less squeeze, the
    # friction may rise until contacts slip.
    min_squeeze = -FIRST_INDENTATION * diameter * grasp.squeeze_stiffness()
    end = squeeze_in_place(grasp, min_squeeze, closing).config.roller_positions
    for steps_left in range(UNLOADING_STEPS, 1, -1):
        start = grasp.config.roller_positions
        target = grasp.config.moved_to(start + (end - start) / steps_left)
        rolled = roll_between(grasp, target, closing)
        grasp = squeeze_in_place(rolled, rolled.squeeze, closing)  # the object back in place
        path.append(grasp.config)
    grasp = squeeze_in_place(grasp, min_squeeze, closing)
    path.append(grasp.config)
    # The grip is opened in place, because a retreat of members in contact would roll the object.
    grip, config = grasp.touching(closing.body.friction_or(None)), grasp.config
    opening = GAP_TOLERANCE * diameter
    command = solve_twist(config, grip, np.zeros(3), limits=(closing.limit,), opening_rate=opening)
    if command.scale < 1.0 - ROUNDING:
        raise RequirementError('squeeze', grasp.squeeze, 0.0)
    path.append(config.moved_to(config.roller_positions + command.roller_velocities))
    return path, replace(closing, body=grasp.body)
