# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Transformation of measured poses, markers and obstacles to the robot frame by tf2."""

from __future__ import annotations

import math
from typing import Any

from geometry_msgs.msg import PoseStamped, Quaternion
from isotruss_msgs.msg import Obstacles
from isotruss_ros.core import Obstacle, Pose, Robot
from isotruss_ros.core.errors import quote
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.nodes.conversions.messages import (
    check_place,
    check_plane,
    check_pose,
    MessageError,
    read_pose,
)
from isotruss_ros.nodes.conversions.obstacle_messages import read_obstacles
from isotruss_ros.nodes.conversions.sensor_messages import read_joint_markers
import numpy as np
from rclpy.node import Node
from rclpy.time import Time
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import MultiDOFJointState
from std_msgs.msg import Header

try:
    from tf2_ros import Buffer, TransformException, TransformListener

    NO_TRANSFORM = (TransformException, ValueError)
except ImportError:
    # It has no wheel for machines without ROS.
    Buffer, NO_TRANSFORM = None, (ValueError,)  # type: ignore[assignment]


class NoTransformError(MessageError):
    """Error: tf2 does not have the transform to the robot frame at a message's stamp yet."""


class RobotFrame:
    """
    Transformation of poses, markers and obstacles to the robot frame at their stamps.

    :param robot: robot with the frame and the marked joints.
    :param buffer: buffer of transforms with the method `lookup_transform` of `tf2_ros`; None
        without tf2, in which case measurements must be in the robot frame.
    """

    def __init__(self, robot: Robot, buffer: Any = None) -> None:
        self._robot, self._buffer = robot, buffer
        self._listener: object = None

    @classmethod
    def heard_by(cls, node: Node, robot: Robot) -> RobotFrame:
        """Return a transformation that uses transforms received by a node, if tf2 is installed."""
        if Buffer is None:
            return cls(robot)
        heard = cls(robot, Buffer())
        heard._listener = TransformListener(heard._buffer, node)  # subscribed while referenced
        return heard

    def read_pose(self, message: PoseStamped) -> Pose:
        """
        Return the measured pose of an object in the robot frame.

        :param message: pose in any frame.
        """
        what, place = 'object pose', message.pose.position
        if message.header.frame_id == self._robot.frame:
            return read_pose(what, message.pose)
        check_pose(what, message.pose)
        rotation, shift = self._look_up(what, message.header)
        turned = rotation @ _rotation_matrix(message.pose.orientation)
        x, y, z = (rotation @ (place.x, place.y, place.z) + shift).tolist()
        check_plane(_name_in_frame(what, message.header), turned[2, 2], z)
        check_place(what, x, y)
        return Pose(x, y, math.atan2(turned[1, 0], turned[0, 0]))

    def read_markers(self, message: MultiDOFJointState) -> dict[str, tuple[float, float]]:
        """
        Return the position (x, y) in the robot frame for the name of each measured joint [m].

        :param message: joint positions in any frame. If heights are not measured, the x-y plane of
            this frame must be the robot's plane.
        """
        joints = read_joint_markers(message, self._robot)
        if message.header.frame_id == self._robot.frame:
            return {name: place[:2] for name, place in joints.items()}
        what = 'joint markers'
        rotation, shift = self._look_up(what, message.header)
        if not any(height for _, _, height in joints.values()):
            check_plane(_name_in_frame(what, message.header), rotation[2, 2], 0.0)
        moved = {}
        for name, place in joints.items():
            x, y, _ = (rotation @ place + shift).tolist()
            check_place(f'joint marker {name}', x, y)
            moved[name] = (x, y)
        return moved

    def read_obstacles(self, message: Obstacles) -> tuple[Obstacle, ...]:
        """
        Return moving obstacles in the robot frame, with the stamp of their message.

        :param message: obstacles in any frame. The x-y plane of this frame must be the robot's.
        """
        what, frame = 'obstacles', message.header.frame_id
        if not message.obstacles or frame in ('', self._robot.frame):
            return read_obstacles(message)
        rotation, shift = self._look_up(what, message.header)
        check_plane(_name_in_frame(what, message.header), rotation[2, 2], 0.0)
        turned = math.atan2(rotation[1, 0], rotation[0, 0])
        return read_obstacles(message, complex(shift[0], shift[1]), turned)

    def _look_up(self, what: str, header: Header) -> tuple[Array, Array]:
        """Return rotation (3, 3) and translation (3,) from the frame of a header at its stamp."""
        words, frame = _name_in_frame(what, header), self._robot.frame
        if self._buffer is None:
            raise MessageError(
                f'{words}: must be {frame!r}; tf2_ros, which transforms frames, is not installed'
            )
        try:
            stamp = Time.from_msg(header.stamp)
            transform = self._buffer.lookup_transform(frame, header.frame_id, stamp).transform
            rotation, shift = _rotation_matrix(transform.rotation), transform.translation
        except NO_TRANSFORM as error:  # ValueError: a stamp before zero, no rotation
            raise NoTransformError(
                f'{words}: tf2 must connect this frame to {frame!r} at the stamp: {error}'
            ) from error
        return rotation, np.array([shift.x, shift.y, shift.z])


def _name_in_frame(what: str, header: Header) -> str:
    """Return the name of a measurement with that of its frame."""
    return f'{what} in frame {quote(header.frame_id)}'


def _rotation_matrix(rotation: Quaternion) -> Array:
    """Return the rotation matrix (3, 3) of a quaternion; ValueError for a zero quaternion."""
    return Rotation.from_quat([rotation.x, rotation.y, rotation.z, rotation.w]).as_matrix()
