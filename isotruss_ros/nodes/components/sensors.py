# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Subscriptions to measured inputs; each keeps the newest value, or why it was rejected."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Protocol

from geometry_msgs.msg import PoseStamped
from isotruss_msgs.msg import StateEstimate
from isotruss_ros.core import Pose, Robot
from isotruss_ros.core.control.inputs import Input, RejectedInput, RollerState, StampedInput
from isotruss_ros.core.control.state_estimate import EstimatedTravel
from isotruss_ros.nodes.components.robot_frame import RobotFrame
from isotruss_ros.nodes.conversions.estimate_messages import read_estimate
from isotruss_ros.nodes.conversions.messages import (
    MessageError,
    read_object_pose,
    read_stamp,
    RollerStateReader,
)
from isotruss_ros.nodes.conversions.pressure_messages import read_tube_pressures
from isotruss_ros.nodes.framework.subscriptions import subscribe_newest
import numpy as np
from rclpy.node import Node
from rclpy.subscription import Subscription
from sensor_msgs.msg import JointState


class InputHolder(Protocol):
    """
    What keeps the latest inputs, as attributes, and decides by them.

    :ivar timeout: largest age of an input [s].
    :ivar estimate: input of an `EstimatedTravel`; None without one.
    """

    timeout: float
    estimate: Input


def subscribe_input(
    node: Node, kind: type, topic: str, read: Callable[[Any], Any], holder: InputHolder, name: str
) -> Subscription:
    """
    Subscribe to messages with a header and keep the newest value as an input.

    :param node: subscribes.
    :param kind: type of the messages.
    :param topic: relative name of the topic.
    :param read: returns the value of a message; raises MessageError for one that is unusable.
    :param holder: gets a StampedInput, or a RejectedInput with the reason.
    :param name: attribute of `holder`.
    """

    def receive(message: Any) -> None:
        try:
            received = StampedInput(read(message), read_stamp(message.header))
        except MessageError as error:
            setattr(holder, name, RejectedInput(str(error)))
            return
        setattr(holder, name, select_latest(getattr(holder, name), received, holder.timeout))

    return subscribe_newest(node, kind, topic, receive)


def subscribe_joint_states(node: Node, robot: Robot, holder: InputHolder) -> None:
    """
    Keep the state of the rollers, from `joint_states`, as `holder.rollers`.

    Where a node publishes `state_estimate`, that is `holder.estimate`, and what it adds to the
    encoders is in the positions of the rollers: the last one stays, as zeros do.

    :param node: subscribes.
    :param robot: whose rollers are read.
    :param holder: gets a StampedInput of a RollerState, or a RejectedInput.
    """
    reader = RollerStateReader(robot.roller_names)
    offsets = np.zeros(len(robot.roller_names))

    def read(message: JointState) -> RollerState:
        state = reader.read(message)
        return RollerState(state.positions + offsets, state.velocities, offsets)

    def read_offsets(message: StateEstimate) -> EstimatedTravel:
        nonlocal offsets
        found = read_estimate(message, robot)
        offsets = found.offsets
        return found

    subscribe_input(node, JointState, 'joint_states', read, holder, 'rollers')
    subscribe_input(node, StateEstimate, 'state_estimate', read_offsets, holder, 'estimate')


def subscribe_object_pose(node: Node, robot: Robot, holder: InputHolder) -> None:
    """
    Keep the measured `Pose` of the object, from `object_pose`, as `holder.pose`.

    :param node: subscribes.
    :param robot: to whose frame that of the pose must be connected, see `RobotFrame`.
    :param holder: gets a StampedInput or a RejectedInput.
    """
    frame = RobotFrame.heard_by(node, robot.frame)

    def read(message: PoseStamped) -> Pose:
        return read_object_pose(frame.express_pose(message), robot.frame)

    subscribe_input(node, PoseStamped, 'object_pose', read, holder, 'pose')


def subscribe_tube_pressures(node: Node, robot: Robot, holder: InputHolder) -> None:
    """
    Keep the gauge pressures of the tubes, from `tube_pressures`, as `holder.pressures`.

    :param node: subscribes.
    :param robot: whose tubes they are.
    :param holder: gets a StampedInput of (t,) pressures [Pa], or a RejectedInput.
    """
    read = partial(read_tube_pressures, robot=robot)
    subscribe_input(node, JointState, 'tube_pressures', read, holder, 'pressures')


def forget_pressures(holder: InputHolder) -> None:
    """
    Rely on no pressures of before any more, nor on those of the robot file in their place.

    :param holder: of pressures.
    """
    if holder.pressures is not None:
        holder.pressures = RejectedInput('tube pressures: none since the clock jumped or stopped')


def select_latest(kept: Input, received: StampedInput, timeout: float) -> Input:
    """
    Return the later of two inputs: messages may overtake each other in transport.

    What is older by more than the timeout was not overtaken: a clock was set back, and what is
    kept is no longer valid.

    :param kept: the input so far.
    :param received: the new input.
    :param timeout: largest age of an input [s].
    """
    if isinstance(kept, StampedInput) and 0.0 < kept.time - received.time < timeout:
        return kept
    return received


def describe_ages(now: float, **inputs: Input) -> dict[str, object]:
    """
    Return the ages of inputs [s], or why they have none, for the diagnostics.

    :param now: time on the clock of their stamps [s].
    :param inputs: by name, with underscores for the spaces in the diagnostics.
    """
    return {
        f'age of {name.replace("_", " ")} [s]': _format_age(given, now)
        for name, given in inputs.items()
    }


def _format_age(given: Input, now: float) -> str:
    if given is None:
        return 'none received'
    return given.reason if isinstance(given, RejectedInput) else f'{now - given.time:.4f}'
