# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Prediction of slip along the path of a held object."""

from __future__ import annotations

import math
from typing import NamedTuple

from isotruss_ros.core.errors import (
    ConfigurationError,
    distinct_numbers,
    GraspError,
    SolverError,
)
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.grip_record import GripRecord
from isotruss_ros.core.holding.held_grip import (
    HeldGrip,
    HoldStatus,
    MIN_RELATIVE_MARGIN,
    NotHeldError,
)
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.limit_handling import LimitHandling, LOOP_SOFT_RANK
from isotruss_ros.core.manipulation.solve_twist import solve_twist
from isotruss_ros.core.model.convex_object import check_friction, ConvexObject
from isotruss_ros.core.model.pose import Pose, pose_difference
from isotruss_ros.core.numerics.arrays import Array, finite_rows, MAX_MAGNITUDE
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.planning.reach_pose import MIN_STEP_SCALE
import numpy as np

#: Length of a step, with rotations times the characteristic radius [m], and largest number of
#: steps [-]; long paths have longer steps.
STEP, MAX_STEPS = 0.005, 400
#: Begin of the reason of an end at which the robot cannot follow the path any further.
OUT_OF_REACH = 'out of reach'
#: Largest error of the pose on the path and at its end [m], and admissible angle per length
#: [rad/m]. The loop stops at errors of 0.9 of its tolerances, by default 10 mm and 0.2 rad, and
#: has reached the end within half of them.
MAX_ERROR, MAX_END_ERROR, ANGLE_WEIGHT = 0.008, 0.005, 20.0
#: Largest number of steps toward one pose [-]; the loop waits somewhat longer before it gives up.
MAX_TRIES = 4
#: Behaviour of the control loop at limits and singular tasks.
LOOP_HANDLING = LimitHandling(True, True, LOOP_SOFT_RANK)


class Foresight(NamedTuple):
    """Predicted motion of a held object along a path, see `foresee_path`."""

    pose: Pose  #: pose at the end of the predicted motion
    share: float  #: fraction of the path that is reached, 0 to 1
    slip_margin: float  #: smallest slip margin on the path [N]
    why: str  #: reason for an end before the end of the path; otherwise empty
    grips: list[HeldGrip]  #: equilibria along the path, the first one at its start


@single_threaded
def foresee_grip(
    config: Configuration,
    body: ConvexObject,
    friction: float,
    poses: Array,
    record: GripRecord | None = None,
) -> Foresight | None:
    """
    Predict the motion of an object in its grip by `foresee_path`; None if no members hold it.

    If there is no `record` of the loop that holds the object, or its motion ends early, the motion
    starts from the equilibrium of `attach_grip`.
    """
    friction = check_friction(friction)
    foresight = None
    grip_sources = [attach_grip] if record is None else [record.restore, attach_grip]
    for find_grip in grip_sources:
        try:
            held = find_grip(config, body)
        except NotHeldError:
            break
        if held.hold(friction) is HoldStatus.HELD:
            foresight = foresee_path(held, friction, poses)
            if foresight.share == 1.0:
                break
    return foresight


@single_threaded
def foresee_path(held: HeldGrip, friction: float, poses: Array) -> Foresight:
    """
    Predict the motion of a held object along a path from rest to rest, at constant squeeze.

    Contacts roll without slip. External loads and barriers are not considered. The motion ends if
    the slip margin becomes less than `MIN_RELATIVE_MARGIN` times the squeeze, or if the object
    does not follow the path, for example where rollers would move much faster than it. Angles
    of the poses are not wrapped to one turn.
    """
    friction = check_friction(friction)
    what = 'the poses of the path (x, y, angle) [m, rad]'
    poses = finite_rows(poses, 3, what, GraspError, MAX_MAGNITUDE)
    if not len(poses):
        raise GraspError('the path has no poses: must have one or more')
    # Goals of the steps at equal path lengths.
    differences = np.abs(np.diff(poses, axis=0)) * (1.0, 1.0, held.arm)
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot.reduce(differences, axis=1))])
    count = min(max(math.ceil(lengths[-1] / STEP), 1), MAX_STEPS)
    samples = np.linspace(0.0, lengths[-1], count + 1)
    shifted = poses - poses[0] + np.array(held.pose)  # the equilibrium may differ from the first
    goals = np.column_stack([np.interp(samples, lengths, values) for values in shifted.T])
    grips, least_margin = [held], held.slip_margin(friction)
    for number, goal in enumerate(goals[1:]):
        largest_error = MAX_ERROR if number + 1 < count else MAX_END_ERROR
        try:
            moved = _approach(grips[-1], friction, held.squeeze, goal, largest_error)
        except ConfigurationError:
            moved = OUT_OF_REACH
        except (GraspError, SolverError) as error:
            if number == 0:
                raise
            moved = str(error)
        if isinstance(moved, str):
            return Foresight(grips[-1].pose, number / count, least_margin, moved, grips)
        least_margin = min(least_margin, moved.slip_margin(friction))
        grips.append(moved)
    return Foresight(grips[-1].pose, 1.0, least_margin, '', grips)


def _approach(
    held: HeldGrip, friction: float, squeeze: float, goal: Array, largest_error: float
) -> HeldGrip | str:
    """Return the grip within an error of a pose (3,), or the reason of a failure."""
    # Where the task is nearly singular, the path waits for the object.
    for _ in range(MAX_TRIES):
        moved = _take_step(held, friction, squeeze, goal)
        if isinstance(moved, str):
            return moved
        x, y, angle = np.abs(pose_difference(goal, moved.pose)).tolist()
        if math.hypot(x, y) <= largest_error and angle <= ANGLE_WEIGHT * largest_error:
            return moved
        held = moved
    return OUT_OF_REACH


def _take_step(held: HeldGrip, friction: float, squeeze: float, goal: Array) -> HeldGrip | str:
    """Return the grip at a pose (3,) [m, rad] with a squeeze [N], or the reason of a failure."""
    # Roller travel for the displacement, as velocities for a unit of time.
    opening = (squeeze - held.squeeze) / held.squeeze_stiffness()
    grip, displacement = held.touching(friction), pose_difference(goal, held.pose)
    command = solve_twist(
        held.config, grip, displacement, handling=LOOP_HANDLING, opening_rate=opening
    )
    if command.scale < MIN_STEP_SCALE:
        return f'{OUT_OF_REACH}: limits of {", ".join(command.limiting)}'
    config = held.config.moved_to(held.config.roller_positions + command.roller_velocities)
    rolled = roll_grip(held, config)
    hold = HoldStatus.NO_BALANCE if rolled is None else rolled.hold(friction)
    if hold is not HoldStatus.HELD:
        return hold.value
    margin, bound = rolled.slip_margin(friction), MIN_RELATIVE_MARGIN * squeeze
    if margin < bound:
        reached, needed = distinct_numbers(margin, bound)
        return f'the slip margin is {reached} N; must be at least {needed} N'
    return rolled
