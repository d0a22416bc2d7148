# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Conversion of object paths and roller trajectories to messages and from messages."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Any

from builtin_interfaces.msg import Duration
from isotruss_msgs.action import FollowObjectPath
from isotruss_ros.core import ObjectPath, PathTracker, Pose, Robot
from isotruss_ros.core.errors import quote
from isotruss_ros.core.inputs import RollerState
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.paths.object_path import MAX_POSES
from isotruss_ros.core.paths.path_servo import PathOutcome
from isotruss_ros.core.paths.path_tracking import Tracking
from isotruss_ros.core.paths.roller_trajectory import RollerTrajectory
from isotruss_ros.nodes.conversions.messages import (
    check_frame,
    make_header,
    MAX_DISTANCE,
    MessageError,
    QUATERNION_TOLERANCE,
    read_pose,
)
from nav_msgs.msg import Path
import numpy as np
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

#: Largest number of points [-]; reading a point takes 20 us of the cycle.
MAX_POINTS = 10_000


def read_object_path(
    message: Path, speed: float, turn_rate: float, robot: Robot, smooth: bool, start: Pose
) -> ObjectPath:
    """
    Return the object path of a goal.

    :param message: poses of the object.
    :param speed: speed of the object's centre along the path [m/s].
    :param turn_rate: largest angular velocity [rad/s].
    :param robot: the robot; the length of its tubes limits the poses.
    :param smooth: whether a spline through the poses replaces straight segments.
    :param start: current pose of the object, the first pose of a path with fewer than two poses.
    :raises MessageError: another frame, a value that is not finite, a pose out of reach, or a
        rotation out of the plane.
    :raises PathError: see `ObjectPath`.
    """
    frame, home = robot.frame, robot.home
    check_frame('path', message.header, frame)
    if len(message.poses) > MAX_POSES:
        raise MessageError(f'the path has {len(message.poses)} poses; must be at most {MAX_POSES}')
    # The sum of tube lengths bounds the distance of any part from the robot at home.
    middle, reach = home.nodes.mean(axis=0), float(home.member_lengths.sum())
    poses = []
    for number, stamped in enumerate(message.poses):
        what, q = f'pose {number} of the path', stamped.pose.orientation
        check_frame(what, stamped.header, frame)
        pose = read_pose(what, stamped.pose)
        away = math.hypot(pose.x - middle[0], pose.y - middle[1])
        if away > reach:
            raise MessageError(
                f'{what}: ({pose.x:g}, {pose.y:g}) m is {away:g} m from the middle of the robot '
                f'at home; must be at most {reach:.3g} m'
            )
        if math.hypot(q.x, q.y) > QUATERNION_TOLERANCE:
            raise MessageError(
                f'{what}: the quaternion has x {q.x} and y {q.y}: the robot is planar; must be 0'
            )
        poses.append(pose)
    if len(poses) > 1:
        return ObjectPath(poses, speed, turn_rate, smooth)
    return ObjectPath([start, *poses], speed, turn_rate, smooth, first=-1)


def to_path_feedback(tracking: Tracking) -> FollowObjectPath.Feedback:
    """
    Return the feedback message of path following.

    :param tracking: tracking of the last cycle.
    """
    return FollowObjectPath.Feedback(
        position_error=tracking.position_error,
        angle_error=tracking.angle_error,
        progress=tracking.progress,
        time_left=tracking.time_left,
    )


def to_path_result(
    outcome: PathOutcome, message: str, tracker: PathTracker | None, last: Tracking | None
) -> FollowObjectPath.Result:
    """
    Return the result message of path following.

    :param outcome: result of path following.
    :param message: result in words.
    :param tracker: tracker of the path; None before its start, then errors are NaN.
    :param last: tracking of the last cycle; None before the first, then errors are NaN.
    """
    result = FollowObjectPath.Result(code=int(outcome), message=message)
    known = tracker is not None and last is not None
    for source, name in (
        (last, 'position_error'),
        (last, 'angle_error'),
        (tracker, 'max_position_error'),
        (tracker, 'max_angle_error'),
        (tracker, 'rms_position_error'),
    ):
        setattr(result, name, getattr(source, name) if known else math.nan)
    return result


def read_roller_trajectory(
    message: JointTrajectory, robot: Robot, here: Array
) -> RollerTrajectory:
    """
    Return a roller trajectory by the positions and times of a message.

    :param message: trajectory of all rollers in any order. If its first point is later than zero,
        it begins at the measured positions.
    :param robot: the robot.
    :param here: (r,) measured roller positions [m].
    :raises MessageError: a roller is missing, unknown or repeated; the number of a point's
        positions is wrong; or a number is not finite or out of range.
    :raises ConfigurationError: see `RollerTrajectory`.
    """
    names, points = list(message.joint_names), message.points
    if len(names) != len(set(names)) or set(names) != set(robot.roller_names):
        given = ', '.join(quote(name) for name in names[:20]) or 'none'
        raise MessageError(
            f'trajectory: joint_names: {given}; must be each of {", ".join(robot.roller_names)}'
        )
    if not 0 < len(points) <= MAX_POINTS:
        raise MessageError(f'trajectory: {len(points)} points; must be 1 to {MAX_POINTS}')
    for number, point in enumerate(points):
        positions = np.asarray(point.positions, dtype=np.float64)
        if positions.shape != (len(names),) or not (np.abs(positions) <= MAX_DISTANCE).all():
            raise MessageError(
                f'trajectory: point {number}: must have {len(names)} positions, '
                f'finite and at most {MAX_DISTANCE:g} m'
            )
    order = [names.index(name) for name in robot.roller_names]
    positions = np.array([point.positions for point in points])[:, order]
    times = [read_duration(point.time_from_start) for point in points]
    if times[0] > 0.0:
        positions, times = np.vstack([here, positions]), [0.0, *times]
    return RollerTrajectory(robot, positions, times)


def to_trajectory_message(
    robot: Robot, positions: Sequence[Sequence[float]], times: Sequence[float]
) -> JointTrajectory:
    """
    Return the message of a roller trajectory.

    :param robot: the robot.
    :param positions: (k, r) waypoints [m].
    :param times: (k,) times of the waypoints, from 0 [s].
    """
    trajectory = JointTrajectory(joint_names=list(robot.roller_names))
    trajectory.header.frame_id = robot.frame
    trajectory.points = [
        JointTrajectoryPoint(positions=row, time_from_start=to_duration(when))
        for row, when in zip(positions, times, strict=True)
    ]
    return trajectory


def to_roller_feedback(
    kind: type, robot: Robot, wanted: RollerState, measured: RollerState, when: float, now: float
) -> Any:
    """
    Return the feedback message with desired and measured states of the rollers.

    :param kind: type of the feedback, of FollowRollerTrajectory or FollowJointTrajectory.
    :param robot: the robot.
    :param wanted: desired state of the rollers.
    :param measured: measured state of the rollers.
    :param when: trajectory time [s].
    :param now: time on the node's clock [s].
    """

    def point(positions: Array, **others: Any) -> JointTrajectoryPoint:
        start = to_duration(when)
        return JointTrajectoryPoint(positions=positions.tolist(), time_from_start=start, **others)

    return kind(
        header=make_header(now, robot.frame),
        joint_names=list(robot.roller_names),
        desired=point(wanted.positions, velocities=wanted.velocities.tolist()),
        actual=point(measured.positions),
        error=point(wanted.positions - measured.positions),
    )


def to_duration(seconds: float) -> Duration:
    """
    Return the message of a duration.

    :param seconds: duration, not negative [s].
    """
    whole, rest = divmod(round(1e9 * seconds), 1_000_000_000)
    return Duration(sec=whole, nanosec=rest)


def read_duration(duration: Duration) -> float:
    """
    Return the duration of a message [s].

    :param duration: message of the duration.
    """
    return duration.sec + 1e-9 * duration.nanosec
