# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Roller positions at which the held object has a desired pose."""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core.errors import ConfigurationError, format_numbers, GraspError, SolverError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.limit_handling import LimitHandling
from isotruss_ros.core.manipulation.limits import APPROACH_RATE, default_limits
from isotruss_ros.core.manipulation.rolling_grip import RollingGrip
from isotruss_ros.core.manipulation.solve_twist import solve_twist_ahead
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.model.pose import Pose, pose_difference, pose_fault
from isotruss_ros.core.numerics.argument_kinds import check_kinds
from isotruss_ros.core.numerics.arrays import Array, finite_array, MAX_MAGNITUDE
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.numerics.records import Record
from isotruss_ros.core.numerics.tolerances import ROUNDING
from isotruss_ros.core.safety.shape_guard import ShapeGuard
import numpy as np
from numpy.typing import ArrayLike

#: Length of a step of the object, with rotations times the characteristic radius [m].
STEP = 2e-3
#: Smallest factor by which limits may shorten a step [-]; a smaller factor ends the motion, so the
#: number of steps is bounded.
MIN_STEP_SCALE = 0.05


@dataclass(frozen=True, eq=False, repr=False)
class ReachedPose(Record, headline=('status', 'why', 'share', 'pose', 'roller_positions')):
    """Result of the motion of a held object to a pose."""

    config: Configuration  #: configuration at the end of the motion
    pose: Pose  #: pose of the object at the end
    share: float  #: executed fraction of the motion, 0 to 1
    #: OK if the pose is reached, otherwise the status of the limit that ended the motion
    status: Status
    why: str  #: sentence that names this limit; empty if the pose is reached
    path: Array  #: (k, r) roller positions along the motion, from its start [m]

    @property
    def roller_positions(self) -> Array:
        """Return the roller positions at the end of the motion, (r,) [m]."""
        return self.config.roller_positions


@check_kinds
@single_threaded
def reach_pose(config: Configuration, grip: Grip, pose: ArrayLike) -> ReachedPose:
    """
    Compute the roller positions that move a held object on a straight line to a pose.

    In each step contacts roll by (19) and (20), within the limits of member lengths and the
    barriers of `ShapeGuard`. Forces are not computed; `foresee_path` computes them.

    :param config: initial configuration.
    :param grip: initial grip.
    :param pose: desired pose (x, y, angle) [m, rad], reached by the shorter rotation.
    :raises GraspError: the pose is not three finite numbers within range, or the members do not
        touch the object.
    """
    what = 'the pose to reach (x, y, angle) [m, rad]'
    goal = finite_array(pose, 3, what, GraspError, MAX_MAGNITUDE)
    if fault := pose_fault(*goal.tolist()):
        raise GraspError(f'{what}: {format_numbers(goal)}: {fault}')
    rolling, path = RollingGrip.attach(config, grip), [config.roller_positions]
    guard = ShapeGuard(config.robot)
    remaining, weights = pose_difference(goal, rolling.pose), (1.0, 1.0, grip.body.arm)
    initial_distance = distance = float(np.linalg.norm(weights * remaining))
    status, why = Status.OK, ''
    while distance > ROUNDING:
        try:
            step = min(1.0, STEP / distance) * remaining
            rolling, status, why = _take_step(rolling, step, guard)
        except (ConfigurationError, GraspError, SolverError) as error:
            status, why = Status.HALT_KINEMATICS, str(error)
        if why:
            break
        path.append(rolling.config.roller_positions)
        remaining = pose_difference(goal, rolling.pose)
        distance = float(np.linalg.norm(weights * remaining))
    share = 1.0 - distance / initial_distance if initial_distance > ROUNDING else 1.0
    status = status if why else Status.OK  # also if a step was slowed
    return ReachedPose(rolling.config, rolling.pose, share, status, why, np.array(path))


def _take_step(
    rolling: RollingGrip, step: Array, guard: ShapeGuard
) -> tuple[RollingGrip, Status, str]:
    """Return the grip after a displacement (3,), or before it with the reason of a failure."""
    config, grip = rolling.config, rolling.grip
    duration = 1.0 / APPROACH_RATE  # in one step a length reaches its bound
    watch = guard.watch(config, grip)
    limits = (*default_limits(config.robot), *watch.limits)
    command = solve_twist_ahead(
        config, grip, step / duration, 0.5 * duration, (), limits, LimitHandling(regularized=True)
    )
    if command.status is Status.UNREACHABLE:
        words = f'the rollers produce {command.reachable_dof} of 3 motions there'
        return rolling, command.status, words
    command = watch.keep(command, np.zeros(len(config.roller_positions)), duration)
    if command.scale < MIN_STEP_SCALE:
        names = ', '.join(command.limiting)
        return rolling, command.status, f'limits of {names}' if names else str(command.status)
    rollers = config.roller_positions + duration * command.roller_velocities
    return rolling.moved_to(config.moved_to(rollers)), command.status, ''
