# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reading of object paths from messages, and conversion of roller trajectories to messages."""

from __future__ import annotations

from collections.abc import Sequence
import math

from builtin_interfaces.msg import Duration
from isotruss_ros.core import ObjectPath, Pose, Robot
from isotruss_ros.core.errors import NoMotionError
from isotruss_ros.core.paths.object_path import MAX_POSES
from isotruss_ros.nodes.conversions.messages import (
    check_frame,
    MessageError,
    QUATERNION_TOLERANCE,
    read_pose,
)
from nav_msgs.msg import Path
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint


def read_object_path(
    message: Path, speed: float, turn_rate: float, robot: Robot, smooth: bool, start: Pose
) -> ObjectPath | None:
    """
    Return the object path in a goal; None if the object is already at the only pose.

    A path with fewer than two poses starts at the current pose of the object, `start`.

    :param speed: speed of the object's centre along the path [m/s].
    :param turn_rate: largest angular velocity [rad/s].
    :param smooth: True for a spline through the poses in place of straight segments.
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
                f'{what}: the quaternion has x {q.x} and y {q.y}; both must be 0 in the plane'
            )
        poses.append(pose)
    if len(poses) > 1:
        return ObjectPath(poses, speed, turn_rate, smooth)
    try:
        return ObjectPath([start, *poses], speed, turn_rate, smooth, first=-1)
    except NoMotionError:
        if not poses:
            raise
        return None


def to_trajectory_message(
    robot: Robot, positions: Sequence[Sequence[float]], times: Sequence[float]
) -> JointTrajectory:
    """
    Convert a roller trajectory to a message.

    :param positions: (k, r) roller positions of the waypoints [m].
    :param times: (k,) times of the waypoints, from 0 [s].
    """
    trajectory = JointTrajectory(joint_names=list(robot.roller_names))
    trajectory.header.frame_id = robot.frame
    trajectory.points = [
        JointTrajectoryPoint(positions=row, time_from_start=to_duration(when))
        for row, when in zip(positions, times, strict=True)
    ]
    return trajectory


def to_duration(seconds: float) -> Duration:
    """
    Convert a duration to a message.

    :param seconds: duration, not negative [s].
    """
    whole, rest = divmod(round(1e9 * seconds), 1_000_000_000)
    return Duration(sec=whole, nanosec=rest)


def read_duration(duration: Duration) -> float:
    """Return the value of a Duration message in seconds."""
    return duration.sec + 1e-9 * duration.nanosec
