# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The measured inputs of a node; of each the newest value is kept, or why it was rejected."""

from __future__ import annotations

from collections.abc import Callable
import contextlib
from functools import partial
from typing import Any

from geometry_msgs.msg import PoseStamped
from isotruss_msgs.msg import StateEstimate
from isotruss_ros.core import Configuration, Robot
from isotruss_ros.core.control.inputs import (
    Input,
    RejectedInput,
    require_fresh,
    RollerState,
    StampedInput,
)
from isotruss_ros.core.control.state_estimate import EstimatedTravel
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.kinematics.configuration import ConfigurationTracker
from isotruss_ros.nodes.conversions.estimate_messages import read_estimate
from isotruss_ros.nodes.conversions.joint_state_messages import (
    read_roller_state,
    read_tube_pressures,
)
from isotruss_ros.nodes.conversions.messages import MessageError, read_stamp
from isotruss_ros.nodes.framework.robot_frame import RobotFrame
from isotruss_ros.nodes.framework.runner import StoppableNode
from isotruss_ros.nodes.framework.topics import subscribe_newest
import numpy as np
from rclpy.subscription import Subscription
from sensor_msgs.msg import JointState


class Inputs:
    """
    Subscriptions of a node; what decides by the inputs gets each as an attribute.

    That is a StampedInput, by the clock of the node where messages have no header, or a
    RejectedInput with the reason.

    :param node: subscribes.
    :param robot: whose rollers, tubes and frame messages must have.
    :param holder: gets the inputs; its `timeout` is the largest age of an input [s].
    """

    def __init__(self, node: StoppableNode, robot: Robot, holder: Any) -> None:
        self._node, self._robot, self._holder = node, robot, holder
        #: What each attribute is, in words.
        self._words: dict[str, str] = {}

    def keep(
        self, kind: type, topic: str, read: Callable[[Any], Any], name: str, words: str = ''
    ) -> Subscription:
        """
        Subscribe to an input.

        :param kind: type of the messages.
        :param topic: relative name of the topic.
        :param read: returns the value of a message; raises MessageError for one that is unusable.
        :param name: attribute of the holder.
        :param words: what it is, for the diagnostics; the topic if left out.
        """
        holder = self._holder
        self._words[name] = words or topic.replace('_', ' ').replace('/', ' ')

        def receive(message: Any) -> None:
            stamped = hasattr(message, 'header')
            try:
                when = read_stamp(message.header) if stamped else self._node.now()
                received = StampedInput(read(message), when)
            except MessageError as error:
                setattr(holder, name, RejectedInput(str(error)))
                return
            setattr(holder, name, _select_latest(getattr(holder, name), received, holder.timeout))

        return subscribe_newest(self._node, kind, topic, receive)

    def keep_joint_states(self) -> None:
        """
        Keep the RollerState, from `joint_states`, as `rollers`.

        Where a node publishes `state_estimate`, its EstimatedTravel is `estimate`, and what it
        adds to the encoders is in the positions of the rollers: the last one stays, as zeros do.
        """
        offsets = np.zeros(len(self._robot.roller_names))

        def read(message: JointState) -> RollerState:
            state = read_roller_state(message, self._robot.roller_names)
            return RollerState(state.positions + offsets, state.velocities, offsets)

        def read_offsets(message: StateEstimate) -> EstimatedTravel:
            nonlocal offsets
            found = read_estimate(message, self._robot)
            offsets = found.offsets
            return found

        self.keep(JointState, 'joint_states', read, 'rollers')
        self.keep(StateEstimate, 'state_estimate', read_offsets, 'estimate')

    def keep_object_pose(self) -> None:
        """Keep the `Pose` of the object, from `object_pose`, as `pose`; see `RobotFrame`."""
        frame = RobotFrame.heard_by(self._node, self._robot)
        self.keep(PoseStamped, 'object_pose', frame.read_pose, 'pose')

    def keep_tube_pressures(self) -> None:
        """Keep the gauge pressures (t,) [Pa], from `tube_pressures`, as `pressures`."""
        read = partial(read_tube_pressures, robot=self._robot)
        self.keep(JointState, 'tube_pressures', read, 'pressures')

    def clear(self) -> None:
        """Discard the inputs: after a jump of the clock their ages are unknown."""
        for name in self._words:
            known = getattr(self._holder, name) is not None
            setattr(self._holder, name, None)
            if name == 'pressures' and known:  # those of the robot file do not count in its place
                why = 'tube pressures: none since the clock jumped or stopped'
                setattr(self._holder, name, RejectedInput(why))

    def describe_ages(self) -> dict[str, object]:
        """Return the ages of the inputs [s], or why they have none, for the diagnostics."""
        ages = {}
        for name, words in self._words.items():
            given = getattr(self._holder, name)
            if isinstance(given, StampedInput):
                age = f'{self._node.now() - given.time:.4f}'
            else:
                age = 'none received' if given is None else given.reason
            ages[f'age of {words} [s]'] = age
        return ages


class TrackedShape:
    """
    Follows the shape of the robot.

    :ivar timeout: largest age of an input [s].
    :ivar rollers: the latest joint states, a StampedInput of a RollerState.
    :ivar estimate: input of the `EstimatedTravel` whose offsets these have; None without one.
    :param robot: at home when the first joint states come.
    :param timeout: see above.
    """

    def __init__(self, robot: Robot, timeout: float) -> None:
        self.timeout = timeout
        self.rollers: Input = None
        self.estimate: Input = None
        self._shapes = ConfigurationTracker(robot.home)
        self._tracked: Input = None

    def track(self) -> None:
        """Take note of the latest joint states."""
        if self.rollers is self._tracked:
            return
        self._tracked = self.rollers
        if isinstance(self.rollers, StampedInput):
            # The next request reports a configuration that does not exist.
            with contextlib.suppress(ConfigurationError):
                self._shapes.configuration(self.rollers.value.positions)

    def configuration(self, now: float) -> Configuration:
        """
        Return the configuration of the latest joint states.

        :param now: time on the clock of the inputs [s].
        :raises InputError: they are missing, stale or invalid.
        :raises ConfigurationError: no configuration fits them.
        """
        (given,) = require_fresh(now, self.timeout, joint_states=self.rollers)
        return self._shapes.configuration(given.value.positions)


def _select_latest(kept: Input, received: StampedInput, timeout: float) -> Input:
    """
    Return the later of two inputs: messages may overtake each other in transport.

    What is older by more than the timeout [s] was not overtaken: a clock was set back, and what is
    kept is no longer valid.
    """
    if isinstance(kept, StampedInput) and 0.0 < kept.time - received.time < timeout:
        return kept
    return received
