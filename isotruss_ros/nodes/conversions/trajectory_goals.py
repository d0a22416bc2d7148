# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reading of the goals of FollowRollerTrajectory and FollowJointTrajectory."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
import math
from typing import Any, NamedTuple

from isotruss_msgs.action import FollowRollerTrajectory
from isotruss_ros.core import Robot
from isotruss_ros.core.errors import format_numbers, quote
from isotruss_ros.core.inputs import CLOCK_SKEW
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.paths.object_path import MAX_DURATION
from isotruss_ros.core.paths.roller_trajectory import (
    check_shapes,
    RollerTrajectory,
    Tolerance,
    TrajectoryTolerances,
)
from isotruss_ros.nodes.conversions.messages import MAX_DISTANCE, MessageError, read_stamp
from isotruss_ros.nodes.conversions.path_messages import read_duration
import numpy as np
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory

#: Largest number of points [-]; each point takes 20 us of the control cycle to read.
MAX_POINTS = 10_000
Result = FollowRollerTrajectory.Result


class TrajectoryGoalError(MessageError):
    """Error: a trajectory goal is invalid; the error has a code of `FollowJointTrajectory`."""

    def __init__(self, code: int, message: str) -> None:
        super().__init__(message)
        self.code = code


class RollerGoal(NamedTuple):
    """Content of an action goal with a roller trajectory."""

    trajectory: RollerTrajectory  #: trajectory of the rollers
    start: float | None  #: start time on the node's clock [s]; None: start at once
    tolerances: TrajectoryTolerances  #: tolerances of the goal


def read_roller_goal(
    goal: Any, robot: Robot, here: Array, now: float, timeout: float
) -> RollerGoal:
    """
    Return the content of an action goal with a roller trajectory.

    :param here: (r,) measured roller positions [m].
    :param timeout: largest age of the stamp [s].
    """
    names = robot.roller_names
    multi = getattr(goal, 'multi_dof_trajectory', None)
    components = [
        name
        for name in ('component_path_tolerance', 'component_goal_tolerance')
        if getattr(goal, name, ())
    ]
    if components or (multi is not None and (multi.joint_names or multi.points)):
        what = ', '.join(components) or 'multi_dof_trajectory'
        raise MessageError(
            f'trajectory: {what}: rollers have one degree of freedom; must be empty'
        )
    trajectory = read_roller_trajectory(goal.trajectory, robot, here)
    start = _read_start(goal.trajectory.header, now, timeout)
    late = goal.goal_time_tolerance
    goal_time = None
    if late.sec or late.nanosec:
        goal_time = math.inf if late.sec < 0 else read_duration(late)
    tolerances = TrajectoryTolerances(
        _read_tolerance('path_tolerance', goal.path_tolerance, names),
        _read_tolerance('goal_tolerance', goal.goal_tolerance, names),
        goal_time,
    )
    return RollerGoal(trajectory, start, tolerances)


def read_roller_trajectory(
    message: JointTrajectory, robot: Robot, here: Array
) -> RollerTrajectory:
    """
    Return the roller trajectory in a message, from its positions and times.

    :param here: (r,) measured roller positions [m], at which the trajectory begins if the time of
        its first point is later than zero.
    """
    names, points, rollers = list(message.joint_names), message.points, robot.roller_names
    _check_joints('joint_names', names, rollers)
    if missing := [name for name in rollers if name not in names]:
        raise TrajectoryGoalError(
            Result.INVALID_JOINTS,
            f'trajectory: joint_names: {", ".join(missing)} are missing; must be all rollers',
        )
    if not 0 < len(points) <= MAX_POINTS:
        raise MessageError(f'trajectory: {len(points)} points; must be 1 to {MAX_POINTS}')
    for number, point in enumerate(points):
        positions = np.asarray(point.positions, dtype=np.float64)
        if positions.shape != (len(names),) or not (np.abs(positions) <= MAX_DISTANCE).all():
            raise MessageError(
                f'trajectory: point {number}: positions {format_numbers(positions[:20])} m: must '
                f'be {len(names)} finite numbers, at most {MAX_DISTANCE:g} m'
            )
    order = [names.index(name) for name in rollers]
    positions = np.array([point.positions for point in points])[:, order]
    times = [read_duration(point.time_from_start) for point in points]
    if times[0] > 0.0:
        positions, times = np.vstack([here, positions]), [0.0, *times]
    trajectory = RollerTrajectory(robot, positions, times)
    check_shapes(robot, positions)
    return trajectory


def _read_start(header: Header, now: float, timeout: float) -> float | None:
    """Return the start time of a trajectory [s]; None if the stamp is zero: start at once."""
    stamp = read_stamp(header)
    if stamp == 0.0:
        return None
    if now - stamp > timeout:
        raise TrajectoryGoalError(
            Result.OLD_HEADER_TIMESTAMP,
            f'trajectory: {now - stamp:.3f} s old; must be at most {timeout:g} s',
        )
    if stamp - now > MAX_DURATION:
        raise MessageError(
            f'trajectory: begins {stamp - now:.3g} s in the future; must be at most '
            f'{MAX_DURATION:g} s'
        )
    return stamp if stamp > now + CLOCK_SKEW else None


def _check_joints(what: str, joints: Sequence[str], names: Sequence[str]) -> None:
    """Raise TrajectoryGoalError if a name does not belong to a roller or is repeated."""
    counts = Counter(joints)
    unknown = [quote(name) for name in counts if name not in names][:20]
    twice = [name for name in names if counts[name] > 1]
    if unknown or twice:
        which, how = (unknown, '') if unknown else (twice, ', each once')
        raise TrajectoryGoalError(
            Result.INVALID_JOINTS,
            f'trajectory: {what}: {", ".join(which)}: must be one of {", ".join(names)}{how}',
        )


def _read_tolerance(
    what: str, tolerances: Sequence[Any], names: Sequence[str]
) -> Tolerance | None:
    """Return the bounds in a list of tolerances; None if the list is empty."""
    _check_joints(what, [tolerance.name for tolerance in tolerances], names)
    bounds = np.full((2, len(names)), math.inf)
    for tolerance in tolerances:
        place = list(names).index(tolerance.name)
        for row, value in enumerate((tolerance.position, tolerance.velocity)):
            if not (value >= 0.0 or value == -1.0):  # excludes NaN
                raise MessageError(
                    f'trajectory: {what} of {tolerance.name}: {value}: must be positive, 0 or -1'
                )
            if value > 0.0:
                bounds[row, place] = value
        if tolerance.acceleration not in (0.0, -1.0):
            raise MessageError(
                f'trajectory: {what} of {tolerance.name}: acceleration '
                f'{tolerance.acceleration}: is not measured; must be 0 or -1'
            )
    return Tolerance(*bounds) if np.isfinite(bounds).any() else None
