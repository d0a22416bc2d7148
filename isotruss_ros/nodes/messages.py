"""Messages to numbers and back; whatever cannot be used is refused with the reason."""

from __future__ import annotations

from collections.abc import Sequence
import math

from geometry_msgs.msg import Pose as PoseMessage
from geometry_msgs.msg import PoseStamped, Quaternion, Twist
from isotruss_ros.core import IsotrussError, Pose, RollerState
import numpy as np
from numpy.typing import NDArray
from rclpy.time import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

#: No roller is quicker [m/s]; what is beyond is a broken sensor, not a motion.
MAX_SPEED = 10.0
#: No object is farther away, and no roller has travelled farther [m].
MAX_DISTANCE = 1e6
#: So much of a name that came in a message is repeated.
MAX_QUOTED = 80
#: A quaternion whose norm is further from 1 than this was never meant as a rotation.
QUATERNION_TOLERANCE = 0.01


class MessageError(IsotrussError, ValueError):
    """A message cannot be used; says what was wrong and what would be right."""


def quoted(name: str) -> str:
    """Return a name that came in a message, in quotes and not without end."""
    return repr(name if len(name) <= MAX_QUOTED else f'{name[:MAX_QUOTED]}…')


def seconds(header: Header) -> float:
    """Return the stamp of a header [s]."""
    return header.stamp.sec + 1e-9 * header.stamp.nanosec


def time_at(when: float) -> Time:
    """Return the time of some seconds [s]; there is none before zero."""
    return Time(nanoseconds=max(0, round(1e9 * when)))


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


def check_frame(what: str, header: Header, frame: str) -> None:
    """
    Refuse another frame; an empty one means the robot's, as in a message without header.

    :param what: the message, for the reason.
    :raises MessageError: names both frames.
    """
    if header.frame_id not in ('', frame):
        raise MessageError(
            f'{what} in frame {quoted(header.frame_id)}: must be in {frame!r} (or leave it empty)'
        )


def object_center(message: PoseStamped, frame: str) -> tuple[float, float]:
    """
    Return the object's centre (x, y) [m].

    :raises MessageError: another frame, not finite, or no rotation in the quaternion.
    """
    if message.header.frame_id != frame:
        raise MessageError(
            f'object pose in frame {quoted(message.header.frame_id)}: must be {frame!r}'
        )
    position, q = message.pose.position, message.pose.orientation
    if not all(abs(coordinate) <= MAX_DISTANCE for coordinate in (position.x, position.y)):
        raise MessageError(
            f'object pose at ({position.x}, {position.y}): must be finite, '
            f'at most {MAX_DISTANCE:g} m away'
        )
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


def twist_message(twist: Sequence[float] | Array, message: Twist | None = None) -> Twist:
    """Return (vx, vy, omega) as a message; fill in the one that is given."""
    message = Twist() if message is None else message
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
        self._places = np.zeros(0, dtype=int)

    def state(self, message: JointState) -> RollerState:
        """
        Return travel (r,) [m] and speeds (r,) [m/s] of the rollers.

        Speeds that the message leaves out, or that are NaN, as a broadcaster puts it where nothing
        is measured, are zero.

        :raises MessageError: a roller is missing or named twice, there are not as many positions
            (or speeds) as names, or a position or a speed cannot be.
        """
        if message.name != self._seen:
            self._places = self._find(message.name)
            self._seen = list(message.name)
        positions = self._pick('positions', message.position)
        if not (np.abs(positions) <= MAX_DISTANCE).all():
            raise MessageError(
                f'joint states: roller positions {positions.tolist()} m: must be finite, '
                f'at most {MAX_DISTANCE:g} m'
            )
        if not message.velocity:
            return RollerState(positions, np.zeros_like(positions))
        velocities = np.nan_to_num(self._pick('velocities', message.velocity), nan=0.0)
        if np.abs(velocities).max() > MAX_SPEED:
            raise MessageError(
                f'joint states: roller velocities {velocities.tolist()} m/s: '
                f'must be at most {MAX_SPEED} m/s'
            )
        return RollerState(positions, velocities)

    def _pick(self, what: str, values: Sequence[float]) -> Array:
        if len(values) != len(self._seen):
            raise MessageError(
                f'joint states: {len(values)} {what} for {len(self._seen)} names; must be as many'
            )
        return np.asarray(values)[self._places]

    def _find(self, names: Sequence[str]) -> Indices:
        missing = [name for name in self._wanted if name not in names]
        if missing:
            raise MessageError(
                f'joint states: rollers {", ".join(missing)} are missing; '
                f'must name {", ".join(self._wanted)}'
            )
        twice = [name for name in self._wanted if names.count(name) > 1]
        if twice:
            raise MessageError(f'joint states: {", ".join(twice)} named twice; must be once')
        return np.array([names.index(name) for name in self._wanted])
