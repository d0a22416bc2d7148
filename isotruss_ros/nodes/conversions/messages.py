# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Conversion between common messages and numbers; invalid messages raise MessageError."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import math
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose as PoseMessage
from geometry_msgs.msg import Twist
from isotruss_msgs.msg import GraspState
from isotruss_ros.core import IsotrussError, Pose
from isotruss_ros.core.errors import quote
from isotruss_ros.core.model.pose import pose_fault
from isotruss_ros.core.numerics.arrays import Array
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from std_msgs.msg import Header

#: Largest valid roller travel [m].
MAX_DISTANCE = 1e6
#: Parts with frames. The object's frame is fixed to the object. The aligned frame has its origin,
#: about which wrenches have their moments, and the robot's axes. The x axis of a contact frame
#: is normal to the member and points into the object; the y axis is along the member.
OBJECT, ALIGNED_OBJECT, CONTACT = 'object', 'object_aligned', '_contact'
#: Value of the field `held` of messages for whether the object is held; None: unknown.
HELD_VALUES = {
    None: GraspState.HELD_UNKNOWN,
    False: GraspState.HELD_NO,
    True: GraspState.HELD_YES,
}
#: Largest accepted deviation of the norm of a quaternion from 1 [-].
QUATERNION_TOLERANCE = 0.01
#: Largest tilt of a measurement out of the robot's plane [degrees], which changes measured lengths
#: by 0.4 %, and largest distance of an object's frame from this plane [m], since the marker of a
#: tracker is on top of the object.
MAX_TILT, MAX_HEIGHT = 5.0, 0.3


class MessageError(IsotrussError, ValueError):
    """Error: a message is invalid; the text names the fault and the valid range."""


class ForeignMessageError(MessageError):
    """Error: a message contains no part of the input, for example joint states of a gripper."""


def read_stamp(header: Header) -> float:
    """Return the time stamp of a message header [s]."""
    return header.stamp.sec + 1e-9 * header.stamp.nanosec


def make_header(when: float, frame: str = '') -> Header:
    """
    Return a message header with a time stamp and a frame.

    :param when: time of the stamp [s]; a negative time is replaced by zero.
    """
    seconds, nanoseconds = divmod(max(0, round(1e9 * when)), 1_000_000_000)
    return Header(stamp=Time(sec=seconds, nanosec=nanoseconds), frame_id=frame)


def read_held(message: Any) -> bool | None:
    """Return whether the object is held according to a message with a field `held`."""
    return None if message.held == GraspState.HELD_UNKNOWN else bool(message.held)


def read_twist(twist: Twist) -> tuple[float, float, float]:
    """Return the planar twist (vx, vy, omega) of a message [m/s, rad/s]."""
    linear, angular = twist.linear, twist.angular
    planar = (linear.x, linear.y, angular.z)
    if not all(map(math.isfinite, planar)):
        raise MessageError(f'twist {planar}: linear.x, linear.y and angular.z must be finite')
    if linear.z or angular.x or angular.y:
        raise MessageError(
            f'twist with linear.z {linear.z}, angular.x {angular.x}, angular.y {angular.y}: '
            'the robot is planar; they must be 0'
        )
    return planar


def check_frame(what: str, header: Header, frame: str) -> None:
    """
    Raise MessageError if a header names another frame than the robot frame.

    An empty name is accepted.
    """
    if header.frame_id not in ('', frame):
        raise MessageError(
            f'{what} in frame {quote(header.frame_id)}: must be in {frame!r} (or leave it empty)'
        )


def request_parameters(values: Mapping[str, Any]) -> SetParameters.Request:
    """Return the service request that sets parameters of another node."""
    messages = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
    return SetParameters.Request(parameters=messages)


def name_frame(frame: str, part: str) -> str:
    """
    Return the name of the frame of the object, of a module or of a contact.

    :param frame: name of the robot frame; if it is empty, the result is empty.
    """
    return f'{frame}_{part.replace("/", "_")}' if frame else ''


def check_place(what: str, x: float, y: float) -> None:
    """
    Raise MessageError if a position in a message is invalid.

    :param x: x of the position [m].
    :param y: y of the position [m].
    """
    if fault := pose_fault(x, y):
        raise MessageError(f'{what} at ({x}, {y}): {fault}')


def check_pose(what: str, message: PoseMessage) -> None:
    """Raise MessageError unless place and rotation of a pose in any frame are valid."""
    position, q = message.position, message.orientation
    check_place(what, position.x, position.y)
    norm = math.hypot(q.x, q.y, q.z, q.w)
    if not abs(norm - 1.0) <= QUATERNION_TOLERANCE:
        raise MessageError(f'{what}: the quaternion has norm {norm}; must be 1')


def check_plane(what: str, cosine: float, height: float) -> None:
    """
    Raise MessageError if a pose is out of the robot's plane.

    :param cosine: cosine of the angle between the z axes of pose and robot frame [-].
    :param height: distance of the pose's origin from the plane [m].
    """
    tilt = math.degrees(math.acos(min(1.0, max(-1.0, cosine))))
    if tilt > MAX_TILT:
        raise MessageError(
            f'{what}: tilted by {tilt:.0f} degrees out of the plane of the robot; must be at most '
            f'{MAX_TILT:g}'
        )
    if not abs(height) <= MAX_HEIGHT:
        raise MessageError(
            f'{what}: z = {height:.3g} m out of the plane of the robot; must be within '
            f'{MAX_HEIGHT:g} m'
        )


def read_pose(what: str, message: PoseMessage, is_at_any_height: bool = False) -> Pose:
    """
    Return the planar pose in a message.

    :param message: pose in the robot frame, or in a frame with the same plane.
    :param is_at_any_height: whether z is ignored, as of obstacles, which the plane crosses.
    """
    check_pose(what, message)
    position, q = message.position, message.orientation
    height = 0.0 if is_at_any_height else position.z
    check_plane(what, 1.0 - 2.0 * (q.x**2 + q.y**2), height)
    angle = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y**2 + q.z**2))
    return Pose(position.x, position.y, angle)


def to_pose_message(pose: Pose) -> PoseMessage:
    """
    Convert a planar pose to a message.

    :param pose: (x, y, angle) [m, rad].
    """
    message = PoseMessage()
    message.position.x, message.position.y = pose.x, pose.y
    message.orientation.z = math.sin(0.5 * pose.angle)
    message.orientation.w = math.cos(0.5 * pose.angle)
    return message


def to_twist_message(twist: Sequence[float] | Array) -> Twist:
    """
    Convert a planar twist to a message.

    :param twist: (vx, vy, omega) [m/s, rad/s].
    """
    message = Twist()
    message.linear.x, message.linear.y = float(twist[0]), float(twist[1])
    message.angular.z = float(twist[2])
    return message
