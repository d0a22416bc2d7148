# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""From a pose of the held object to roller positions that bring it there."""

from __future__ import annotations

from dataclasses import dataclass
import math

from isotruss_ros.core.errors import ConfigurationError, GraspError, SolverError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.limit_handling import LimitHandling
from isotruss_ros.core.manipulation.limits import default_limits
from isotruss_ros.core.manipulation.rolling_grip import RollingGrip
from isotruss_ros.core.manipulation.solve_twist import solve_twist_ahead
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.model.pose import MAX_DISTANCE, Pose, pose_difference
from isotruss_ros.core.numerics.arrays import Array, finite_array
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.numerics.records import Record
from isotruss_ros.core.safety.shape_guard import ShapeGuard
import numpy as np
from numpy.typing import ArrayLike

#: The object is moved in steps of this length, turns at its arm [m] ...
STEP = 2e-3
#: ... by twists of this speed, at which limits of lengths and shapes do not slow yet [m/s].
SPEED = 0.02
#: The object is there when no more than this is missing [m, turns at the arm].
TOLERANCE = 1e-9
#: A step that limits slow to less than this ends the way [-].
LEAST_SCALE = 0.05
#: Limits may make the way take so many times as many steps.
PATIENCE = 20


@dataclass(frozen=True, eq=False, repr=False)
class ReachedPose(Record, headline=('status', 'why', 'share', 'pose', 'roller_positions')):
    """Where the robot brings a held object."""

    config: Configuration  #: of the robot at the end of the way
    pose: Pose  #: of the object there
    share: float  #: of the way from the first pose to the one asked for, 0 to 1
    status: Status  #: OK where the pose is reached; else what ends the way
    why: str  #: the same in words; empty where the pose is reached
    path: Array  #: (k, r) roller positions on the way, the first ones included [m]

    @property
    def roller_positions(self) -> Array:
        """Return the (r,) roller positions at the end of the way [m]."""
        return self.config.roller_positions


@single_threaded
def reach_pose(
    config: Configuration, grip: Grip, pose: ArrayLike, guard: ShapeGuard | None = None
) -> ReachedPose:
    """
    Move a held object straight to a pose, and return where the rollers are then.

    Contacts roll, (19) and (20) step by step; the members keep their limits of length, and the
    robot its barriers. Nothing is said of forces: see `foresee_path` for these.

    :param config: where the robot is.
    :param grip: how it holds the object.
    :param pose: (x, y, angle) to be reached; turned the shorter way [m, rad].
    :param guard: the barriers; those of `ShapeGuard(robot)` if None.
    :raises GraspError: the pose is not three finite numbers within range, or the members do not
        touch the object.
    """
    what = 'the pose to reach (x, y, angle) [m, rad]'
    goal = finite_array(pose, 3, what, GraspError, MAX_DISTANCE)
    guard = guard or ShapeGuard(config.robot)
    rolling, path = RollingGrip.attach(config, grip), [config.roller_positions]
    left = pose_difference(goal, rolling.pose)
    whole = size = math.hypot(*left[:2], grip.body.arm * left[2])
    for _ in range(PATIENCE * (math.ceil(whole / STEP) + 1)):
        if size <= TOLERANCE:
            status, why = Status.OK, ''
            break
        try:
            moved, status, why = _take_step(rolling, min(1.0, STEP / size) * left, guard)
        except (ConfigurationError, GraspError, SolverError) as error:
            moved, status, why = None, Status.HALT_KINEMATICS, str(error)
        if moved is None:
            break
        rolling = moved
        path.append(rolling.config.roller_positions)
        left = pose_difference(goal, rolling.pose)
        size = math.hypot(*left[:2], grip.body.arm * left[2])
    else:
        status, why = Status.SLOWED_OBJECT, 'the way takes too many steps next to limits'
    share = 1.0 - size / whole if whole > TOLERANCE else 1.0
    return ReachedPose(rolling.config, rolling.pose, share, status, why, np.array(path))


def _take_step(
    rolling: RollingGrip, step: Array, guard: ShapeGuard
) -> tuple[RollingGrip | None, Status, str]:
    """Return the grip after a displacement (3,), or None, the status and why there is none."""
    config, grip = rolling.config, rolling.grip
    duration = STEP / SPEED
    watch = guard.watch(config, grip)
    limits = (*default_limits(config.robot), *watch.limits)
    command = solve_twist_ahead(
        config, grip, step / duration, 0.5 * duration, (), limits, LimitHandling(period=duration)
    )
    if command.status is Status.UNREACHABLE:
        words = f'the rollers produce {command.reachable_dof} of 3 motions there'
        return None, command.status, words
    command = watch.keep(command, np.zeros(len(config.roller_positions)), duration)
    if command.scale < LEAST_SCALE:
        named = ', '.join(command.limiting)
        return None, command.status, f'limits of {named}' if named else str(command.status)
    travel = config.roller_positions + duration * command.roller_velocities
    return rolling.moved_to(config.moved_to(travel)), command.status, ''
