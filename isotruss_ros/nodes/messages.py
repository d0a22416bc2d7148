"""Messages to numbers and back; whatever cannot be used is refused with the reason."""

from __future__ import annotations

from collections.abc import Sequence
import math

from geometry_msgs.msg import Pose as PoseMessage
from geometry_msgs.msg import PoseStamped, Quaternion, Twist, TwistStamped
from isotruss_ros.core import IsotrussError, Pose
import numpy as np
from numpy.typing import NDArray
from rclpy.time import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header

Array = NDArray[np.float64]

#: A quaternion whose norm is further from 1 than this was never meant as a rotation.
QUATERNION_TOLERANCE = 0.01


class MessageError(IsotrussError, ValueError):
    """A message cannot be used; says what was wrong and what would be right."""


def seconds(header: Header) -> float:
    """Return the stamp of a header [s]."""
    return header.stamp.sec + 1e-9 * header.stamp.nanosec


def stamp(header: Header, time: Time, frame: str = '') -> Header:
    """Fill in a header and return it."""
    header.stamp = time.to_msg()
    header.frame_id = frame
    return header


def planar_twist(twist: Twist) -> tuple[float, float, float]:
    """
    Return (vx, vy, omega) [m/s, rad/s].

    :raises MessageError: not finite, or a motion out of the plane.
    """
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


def check_twist_frame(message: TwistStamped, frame: str) -> None:
    """
    Refuse a twist in another frame; an empty one means the robot's, as in a plain Twist.

    :raises MessageError: names both frames.
    """
    if message.header.frame_id not in ('', frame):
        raise MessageError(
            f'twist in frame {message.header.frame_id!r}: must be in {frame!r} (or leave it empty)'
        )


def object_center(message: PoseStamped, frame: str) -> tuple[float, float]:
    """
    Return the object's centre (x, y) [m].

    :raises MessageError: another frame, not finite, or no rotation in the quaternion.
    """
    if message.header.frame_id != frame:
        raise MessageError(f'object pose in frame {message.header.frame_id!r}: must be {frame!r}')
    position, q = message.pose.position, message.pose.orientation
    if not all(map(math.isfinite, (position.x, position.y))):
        raise MessageError(f'object pose at ({position.x}, {position.y}): must be finite')
    norm = math.hypot(q.x, q.y, q.z, q.w)
    if not abs(norm - 1.0) <= QUATERNION_TOLERANCE:
        raise MessageError(f'object pose: the quaternion has norm {norm}; must be 1')
    return position.x, position.y


def pose_message(pose: Pose) -> PoseMessage:
    """Return a planar pose as a message."""
    message = PoseMessage()
    message.position.x, message.position.y = pose.x, pose.y
    message.orientation = Quaternion(z=math.sin(0.5 * pose.angle), w=math.cos(0.5 * pose.angle))
    return message


def twist_message(twist: Sequence[float] | Array) -> Twist:
    """Return (vx, vy, omega) as a message."""
    message = Twist()
    message.linear.x, message.linear.y = float(twist[0]), float(twist[1])
    message.angular.z = float(twist[2])
    return message


def command_message(velocities: Array) -> Float64MultiArray:
    """Return roller velocities [m/s] as a velocity group controller takes them."""
    return Float64MultiArray(data=velocities.tolist())


class RollerStates:
    """
    Picks the rollers out of joint states by name, in whatever order and company they come.

    :param names: the rollers, in the order wanted.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._wanted = tuple(names)
        self._seen: list[str] | None = None
        self._places: list[int] = []

    def positions(self, message: JointState) -> Array:
        """
        Return the roller travel (r,) [m].

        :raises MessageError: a roller is missing or named twice, as many names as positions are
            not there, or a position is not finite.
        """
        if message.name != self._seen:
            self._places = self._find(message.name)
            self._seen = list(message.name)
        if len(message.position) != len(message.name):
            raise MessageError(
                f'joint states: {len(message.position)} positions for {len(message.name)} names; '
                'must be as many'
            )
        positions = np.array([message.position[place] for place in self._places])
        if not np.isfinite(positions).all():
            raise MessageError(
                f'joint states: roller positions {positions.tolist()} m: must be finite'
            )
        return positions

    def _find(self, names: Sequence[str]) -> list[int]:
        missing = [name for name in self._wanted if name not in names]
        if missing:
            raise MessageError(
                f'joint states: rollers {", ".join(missing)} are missing; '
                f'must name {", ".join(self._wanted)}'
            )
        twice = [name for name in self._wanted if names.count(name) > 1]
        if twice:
            raise MessageError(f'joint states: {", ".join(twice)} named twice; must be once')
        return [names.index(name) for name in self._wanted]
