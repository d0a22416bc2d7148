# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What a tracker measures, from any frame that tf2 connects to the robot's."""

from __future__ import annotations

import math
from typing import Any

from geometry_msgs.msg import Point, PoseStamped, Quaternion, Vector3
from geometry_msgs.msg import Pose as PoseMessage
from geometry_msgs.msg import Transform as TransformMessage
from isotruss_ros.core.errors import quote
from isotruss_ros.nodes.conversions.messages import MessageError
from rclpy.node import Node
from rclpy.time import Time
from sensor_msgs.msg import MultiDOFJointState
from std_msgs.msg import Header

try:
    from tf2_ros import Buffer, TransformException, TransformListener

    NO_TRANSFORM = (TransformException, ValueError)
except ImportError:
    # There are no wheels of it for a machine without ROS.
    Buffer, NO_TRANSFORM = None, (ValueError,)

#: What is tilted by more is not in the plane of the robot [rad]: lengths would be 0.4 % off.
MAX_TILT = math.radians(5.0)


class RobotFrame:
    """
    Expresses poses and markers in the robot's frame, by the transforms at their stamps.

    :param frame: the robot's frame.
    :param buffer: of the transforms, with `lookup_transform` as that of `tf2_ros`; None where tf2
        is not at hand, and frames must match.
    """

    def __init__(self, frame: str, buffer: Any = None) -> None:
        self.frame, self._buffer = frame, buffer
        self._listener: object = None

    @classmethod
    def heard_by(cls, node: Node, frame: str) -> RobotFrame:
        """
        Return the robot's frame with the transforms that a node hears, where tf2 is at hand.

        :param node: listens to `/tf` and `/tf_static`.
        :param frame: the robot's frame.
        """
        if Buffer is None:
            return cls(frame)
        heard = cls(frame, Buffer())
        heard._listener = TransformListener(heard._buffer, node)  # listens while it is kept
        return heard

    def express_pose(self, message: PoseStamped) -> PoseStamped:
        """
        Return the measured pose of an object in the robot's frame.

        :param message: in any frame.
        :raises MessageError: no transform from its frame, or a pose out of the robot's plane.
        """
        if message.header.frame_id == self.frame:
            return message
        what = 'object pose'
        moved = self._look_up(what, message.header)
        pose = PoseMessage(
            position=_move(moved, message.pose.position),
            orientation=_multiply(moved.rotation, message.pose.orientation),
        )
        self._check_plane(what, message.header, pose.orientation)
        return PoseStamped(header=self._header(message.header), pose=pose)

    def express_markers(self, message: MultiDOFJointState) -> MultiDOFJointState:
        """
        Return measured joints in the robot's frame.

        :param message: in any frame; where no place has a height there, it must be in the plane.
        :raises MessageError: no transform from its frame, or places out of the robot's plane.
        """
        if message.header.frame_id == self.frame:
            return message
        what = 'joint markers'
        moved = self._look_up(what, message.header)
        places = [transform.translation for transform in message.transforms]
        if not any(place.z for place in places):
            self._check_plane(what, message.header, moved.rotation)
        points = [_move(moved, place) for place in places]
        return MultiDOFJointState(
            header=self._header(message.header),
            joint_names=message.joint_names,
            transforms=[
                TransformMessage(translation=Vector3(x=point.x, y=point.y, z=point.z))
                for point in points
            ],
        )

    def _header(self, header: Header) -> Header:
        return Header(stamp=header.stamp, frame_id=self.frame)

    def _look_up(self, what: str, header: Header) -> TransformMessage:
        """Return the transform from a frame at a stamp."""
        words = f'{what} in frame {quote(header.frame_id)}'
        if self._buffer is None:
            raise MessageError(
                f'{words}: must be {self.frame!r}; tf2_ros, which would connect them, is not '
                'installed'
            )
        try:
            stamp = Time.from_msg(header.stamp)
            return self._buffer.lookup_transform(self.frame, header.frame_id, stamp).transform
        except NO_TRANSFORM as error:  # ValueError: a stamp before zero
            raise MessageError(
                f'{words}: tf2 does not connect it to {self.frame!r} at its stamp: {error}'
            ) from error

    def _check_plane(self, what: str, header: Header, turned: Quaternion) -> None:
        """Refuse what is tilted out of the robot's plane."""
        upright = 1.0 - 2.0 * (turned.x**2 + turned.y**2)
        if upright < math.cos(MAX_TILT):
            tilt = math.degrees(math.acos(max(upright, -1.0)))
            raise MessageError(
                f'{what} in frame {quote(header.frame_id)}: tilted by {tilt:.0f} degrees out of '
                f'the plane of {self.frame!r}; must be at most {math.degrees(MAX_TILT):.0f}'
            )


def _move(transform: TransformMessage, point: Any) -> Point:
    """Return a point in the other frame."""
    q, shift = transform.rotation, transform.translation
    turned = _multiply(_multiply(q, Quaternion(x=point.x, y=point.y, z=point.z, w=0.0)), _back(q))
    return Point(x=turned.x + shift.x, y=turned.y + shift.y, z=turned.z + shift.z)


def _back(q: Quaternion) -> Quaternion:
    """Return the rotation back."""
    return Quaternion(x=-q.x, y=-q.y, z=-q.z, w=q.w)


def _multiply(p: Quaternion, q: Quaternion) -> Quaternion:
    """Return the rotation by q and then by p; its norm is the product of both."""
    return Quaternion(
        x=p.w * q.x + p.x * q.w + p.y * q.z - p.z * q.y,
        y=p.w * q.y - p.x * q.z + p.y * q.w + p.z * q.x,
        z=p.w * q.z + p.x * q.y - p.y * q.x + p.z * q.w,
        w=p.w * q.w - p.x * q.x - p.y * q.y - p.z * q.z,
    )
