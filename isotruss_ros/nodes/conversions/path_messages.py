# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Paths and poses as messages: goals in, feedback and results out."""

from __future__ import annotations

import math

from isotruss_msgs.action import FollowObjectPath
from isotruss_ros.core import ObjectPath, PathTracker, Pose, Robot
from isotruss_ros.core.control.object_path import MAX_POSES
from isotruss_ros.core.control.path_servo import Outcome
from isotruss_ros.core.control.path_tracking import Tracking
from isotruss_ros.nodes.conversions.messages import (
    check_frame,
    MessageError,
    QUATERNION_TOLERANCE,
    read_pose,
)
from nav_msgs.msg import Path


def read_object_path(
    message: Path, speed: float, turn_rate: float, robot: Robot, smooth: bool, start: Pose
) -> ObjectPath:
    """
    Return the path of a goal.

    :param message: poses of the object.
    :param speed: of the object's centre along the path [m/s].
    :param turn_rate: largest rate of turn [rad/s].
    :param robot: which must be able to reach the poses, by the length of its tubes.
    :param smooth: whether corners are rounded.
    :param start: where the object is: there a path of one pose begins.
    :raises MessageError: another frame, not finite, out of reach, or a rotation out of the plane.
    :raises PathError: see `ObjectPath`.
    """
    frame, home = robot.frame, robot.home
    check_frame('path', message.header, frame)
    if len(message.poses) > MAX_POSES:
        raise MessageError(f'the path has {len(message.poses)} poses; must be at most {MAX_POSES}')
    # No part of the robot gets farther from where it stands: no path through the tubes is longer.
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


def to_feedback_message(tracking: Tracking) -> FollowObjectPath.Feedback:
    """
    Return the feedback of the action.

    :param tracking: of the last cycle.
    """
    return FollowObjectPath.Feedback(
        position_error=tracking.position_error,
        angle_error=tracking.angle_error,
        progress=tracking.progress,
        time_left=tracking.time_left,
    )


def to_result_message(
    outcome: Outcome, message: str, tracker: PathTracker | None, last: Tracking | None
) -> FollowObjectPath.Result:
    """
    Return the result of the action.

    :param outcome: why the goal ended.
    :param message: in words.
    :param tracker: of the path; None if it never began: errors are not a number then.
    :param last: of its last cycle, likewise.
    """
    result = FollowObjectPath.Result(code=int(outcome), message=message)
    known = tracker is not None and last is not None
    for source, names in (
        (last, ('position_error', 'angle_error')),
        (tracker, ('max_position_error', 'max_angle_error', 'rms_position_error')),
    ):
        for name in names:
            setattr(result, name, getattr(source, name) if known else math.nan)
    return result
