"""What the sensors say, as samples and refusals for whoever decides by them."""

from __future__ import annotations

from typing import Protocol

from geometry_msgs.msg import PoseStamped
from isotruss_ros.core import Refusal, Robot, Sample
from isotruss_ros.core.samples import Input
from isotruss_ros.nodes.messages import MessageError, object_center, RollerStates, seconds
from isotruss_ros.nodes.newest import subscribe_newest
from rclpy.node import Node
from sensor_msgs.msg import JointState


class Measured(Protocol):
    """Whoever decides: keeps the latest of each."""

    rollers: Input
    center: Input
    timeout: float


class Sensors:
    """
    Hears joint states and the object's pose.

    :param node: subscribes.
    :param robot: whose rollers and frame.
    :param target: gets what came, as soon as it comes.
    """

    def __init__(self, node: Node, robot: Robot, target: Measured) -> None:
        self._frame = robot.frame
        self._roller_states = RollerStates(robot.roller_names)
        self._target = target
        subscribe_newest(node, JointState, 'joint_states', self._take_joint_states)
        subscribe_newest(node, PoseStamped, 'object_pose', self._take_object_pose)

    def _take_joint_states(self, message: JointState) -> None:
        try:
            came = Sample(self._roller_states.state(message), seconds(message.header))
            self._target.rollers = latest(self._target.rollers, came, self._target.timeout)
        except MessageError as error:
            self._target.rollers = Refusal(str(error))

    def _take_object_pose(self, message: PoseStamped) -> None:
        try:
            came = Sample(object_center(message, self._frame), seconds(message.header))
            self._target.center = latest(self._target.center, came, self._target.timeout)
        except MessageError as error:
            self._target.center = Refusal(str(error))


def latest(kept: Input, came: Sample, timeout: float) -> Input:
    """
    Return which of two holds now: messages may overtake each other on their way.

    What is older by more than the time-out did not lose a race: a clock was set, and what is kept
    holds no longer.

    :param kept: what came before.
    :param timeout: largest age of what is relied on [s].
    """
    if isinstance(kept, Sample) and 0.0 < kept.time - came.time < timeout:
        return kept
    return came


def age(given: Input, now: float) -> str:
    """Return the age of an input [s], or why it has none."""
    if given is None:
        return 'none received'
    return given.reason if isinstance(given, Refusal) else f'{now - given.time:.4f}'
