"""What the sensors say, as samples and refusals for whoever decides by them."""

from __future__ import annotations

from typing import Protocol

from geometry_msgs.msg import PoseStamped
from isotruss_ros.core import Refusal, Robot, Sample
from isotruss_ros.core.samples import Input
from isotruss_ros.nodes.messages import MessageError, object_center, RollerStates, seconds
from isotruss_ros.nodes.qos import LATEST
from rclpy.node import Node
from sensor_msgs.msg import JointState


class Measured(Protocol):
    """Whoever decides: keeps the latest of each."""

    rollers: Input
    center: Input


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
        node.create_subscription(JointState, 'joint_states', self._take_joint_states, LATEST)
        node.create_subscription(PoseStamped, 'object_pose', self._take_object_pose, LATEST)

    def _take_joint_states(self, message: JointState) -> None:
        try:
            state = self._roller_states.state(message)
            self._target.rollers = Sample(state, seconds(message.header))
        except MessageError as error:
            self._target.rollers = Refusal(str(error))

    def _take_object_pose(self, message: PoseStamped) -> None:
        try:
            center = object_center(message, self._frame)
            self._target.center = Sample(center, seconds(message.header))
        except MessageError as error:
            self._target.center = Refusal(str(error))


def age(given: Input, now: float) -> str:
    """Return the age of an input [s], or why it has none."""
    if given is None:
        return 'none received'
    return given.reason if isinstance(given, Refusal) else f'{now - given.time:.4f}'
