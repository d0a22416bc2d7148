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
from isotruss_ros.core.errors import quote
from isotruss_ros.core.inputs import CLOCK_SKEW
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.paths.object_path import MAX_DURATION
from isotruss_ros.core.paths.roller_trajectory import RollerTrajectory
from isotruss_ros.core.paths.trajectory_tolerances import Tolerance, TrajectoryTolerances
from isotruss_ros.nodes.conversions.messages import MessageError, read_stamp
from isotruss_ros.nodes.conversions.path_messages import read_duration, read_roller_trajectory
import numpy as np
from std_msgs.msg import Header

Result = FollowRollerTrajectory.Result


class TrajectoryGoalError(MessageError):
    """
    A trajectory goal is invalid; the code is an error code of `FollowJointTrajectory`.

    :ivar code: error code of the result.
    :param code: error code of the result.
    :param message: reason in words.
    """

    def __init__(self, code: int, message: str) -> None:
        super().__init__(message)
        self.code = code


class RollerGoal(NamedTuple):
    """
    Arguments of a roller trajectory's goal.

    :ivar trajectory: trajectory of the rollers.
    :ivar start: start time on the node's clock [s]; None: at once.
    :ivar tolerances: tolerances of the goal.
    """

    trajectory: RollerTrajectory
    start: float | None
    tolerances: TrajectoryTolerances


def read_start(header: Header, now: float, timeout: float) -> float | None:
    """
    Return the start time of a trajectory [s]; None: at once.

    :param header: header of the trajectory; a stamp of zero means at once.
    :param now: time on the clock of the node [s].
    :param timeout: largest age of the stamp [s].
    :raises TrajectoryGoalError: the stamp is too old.
    :raises MessageError: the stamp is more than a day ahead.
    """
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


def read_roller_goal(
    goal: Any, robot: Robot, here: Array, now: float, timeout: float
) -> RollerGoal:
    """
    Return the arguments of a trajectory goal.

    :param goal: goal of FollowRollerTrajectory or FollowJointTrajectory.
    :param robot: the robot.
    :param here: (r,) measured roller positions [m].
    :param now: time on the clock of the node [s].
    :param timeout: largest age of the stamp, see `read_start` [s].
    :raises TrajectoryGoalError: a joint is unknown or missing, or the stamp is too old.
    :raises MessageError: invalid tolerances, or fields that rollers do not have; or see
        `read_roller_trajectory`.
    :raises ConfigurationError: see `RollerTrajectory`.
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
    _check_joints('joint_names', goal.trajectory.joint_names, names)
    if set(goal.trajectory.joint_names) != set(names):
        missing = [name for name in names if name not in goal.trajectory.joint_names]
        raise TrajectoryGoalError(
            Result.INVALID_JOINTS, f'trajectory: joint_names: {", ".join(missing)} are missing'
        )
    start = read_start(goal.trajectory.header, now, timeout)
    late = goal.goal_time_tolerance
    goal_time = None
    if late.sec or late.nanosec:
        goal_time = math.inf if late.sec < 0 else read_duration(late)
    tolerances = TrajectoryTolerances(
        _read_tolerance('path_tolerance', goal.path_tolerance, names),
        _read_tolerance('goal_tolerance', goal.goal_tolerance, names),
        goal_time,
    )
    return RollerGoal(read_roller_trajectory(goal.trajectory, robot, here), start, tolerances)


def _check_joints(what: str, given: Sequence[str], names: Sequence[str]) -> None:
    """Raise TrajectoryGoalError for names that are not rollers or are repeated."""
    counts = Counter(given)
    unknown = [quote(name) for name in counts if name not in names][:20]
    twice = [name for name in names if counts[name] > 1]
    if unknown or twice:
        which, how = (unknown, '') if unknown else (twice, ' once')
        raise TrajectoryGoalError(
            Result.INVALID_JOINTS,
            f'trajectory: {what}: {", ".join(which)}: must be{how} of {", ".join(names)}',
        )


def _read_tolerance(what: str, given: Sequence[Any], names: Sequence[str]) -> Tolerance | None:
    """Return the bounds in a list of tolerances; None for an empty list."""
    _check_joints(what, [each.name for each in given], names)
    bounds = np.full((2, len(names)), math.inf)
    for each in given:
        place = list(names).index(each.name)
        for row, value in enumerate((each.position, each.velocity)):
            if not (value >= 0.0 or value == -1.0):  # excludes NaN
                raise MessageError(
                    f'trajectory: {what} of {each.name}: {value}: must be positive, 0 or -1'
                )
            if value > 0.0:
                bounds[row, place] = value
        if each.acceleration not in (0.0, -1.0):
            raise MessageError(
                f'trajectory: {what} of {each.name}: acceleration {each.acceleration}: is not '
                'measured; must be 0 or -1'
            )
    return Tolerance(*bounds) if np.isfinite(bounds).any() else None
