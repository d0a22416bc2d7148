# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Subscriptions that store, for each input, its latest value or the reason of its rejection."""

from __future__ import annotations

from collections.abc import Callable
import contextlib
import functools
from functools import partial
import math
from typing import Any

from geometry_msgs.msg import PoseStamped
from isotruss_msgs.msg import HeldGrip, StateEstimate
from isotruss_ros.core import Configuration, Robot
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.estimation.roller_parts import RollerParts
from isotruss_ros.core.inputs import (
    Input,
    InputFault,
    keep_latest,
    RejectedInput,
    require_fresh,
    RollerState,
    StampedInput,
)
from isotruss_ros.core.kinematics.configuration import ConfigurationTracker
from isotruss_ros.nodes.conversions.estimate_messages import read_estimate
from isotruss_ros.nodes.conversions.grip_messages import read_grip
from isotruss_ros.nodes.conversions.joint_state_messages import (
    read_roller_part,
    read_tube_pressure,
)
from isotruss_ros.nodes.framework.gate import Gate
from isotruss_ros.nodes.framework.robot_frame import RobotFrame
from isotruss_ros.nodes.framework.runner import StoppableNode
import numpy as np
from rclpy.subscription import Subscription
from sensor_msgs.msg import FluidPressure, JointState, MultiDOFJointState

#: Callback that receives an input.
Take = Callable[[StampedInput], None]
Receive = Callable[[StampedInput | RejectedInput], None]


class Inputs:
    """
    Subscriptions of a node that store inputs as attributes of a holder.

    A `Gate` checks each message and converts it to a StampedInput, or to a RejectedInput with the
    reason. A message without a header is stamped by the node's clock.

    :param node: subscribing node.
    :param robot: robot with the rollers, tubes and frame of the messages.
    :param holder: object whose attributes are the inputs.
    :param oldest: largest age of an input [s]; None: the node's parameter `command_timeout`.
    """

    def __init__(
        self, node: StoppableNode, robot: Robot, holder: Any, oldest: float | None = None
    ) -> None:
        self._node, self._robot, self._holder = node, robot, holder
        self._oldest = oldest
        self._gates: dict[str, Gate] = {}
        #: Descriptions of the inputs by the name of the attribute.
        self._words: dict[str, str] = {}
        self._parts = RollerParts(robot.roller_names)
        self._offsets = np.zeros(len(robot.roller_names))
        self._pressures: dict[str, Input] = {}
        #: Last rejected message of a pressure, and its time [s].
        self._bad_pressure: tuple[RejectedInput | None, float] = None, -math.inf

    def _latest(self, name: str) -> Input:
        """Return the stored input of a name."""
        return getattr(self._holder, name)

    def _store(self, name: str, given: Input) -> None:
        """Replace the stored input of a name."""
        setattr(self._holder, name, given)

    def keep(
        self,
        kind: type,
        topic: str,
        read: Callable[[Any], Any],
        name: str,
        words: str = '',
        stops: bool = False,
        take: Take | None = None,
        oldest: float | None = None,
    ) -> Subscription:
        """
        Subscribe to a topic, and store the value of the newest message as an input.

        :param kind: type of the messages.
        :param topic: relative name of the topic.
        :param read: function that returns the value of a message, or None if the message is
            ignored. It raises MessageError for an invalid message.
        :param name: name of the holder's attribute.
        :param words: description of the input in the diagnostics; by default the name of the
            topic.
        :param stops: whether an invalid message replaces the input, which stops the robot at once;
            otherwise the previous value remains valid.
        :param take: callback that receives every StampedInput, even if its stamp is older than the
            stamp of the stored input; None: no callback.
        :param oldest: largest age of this input [s]; None: the largest age of all inputs applies.
        """
        words, oldest = words or topic.replace('_', ' ').replace('/', ' '), oldest or self._oldest
        setting = 'pressure_timeout' if name == 'pressures' else 'command_timeout'

        def receive(received: StampedInput | RejectedInput) -> None:
            valid = isinstance(received, StampedInput)
            erased = stops and not valid and received.fault is InputFault.INVALID
            kept = None if erased else self._latest(name)
            self._store(name, keep_latest(kept, received, self._node.now()))
            if valid and take is not None:
                take(received)  # type: ignore[arg-type]

        def timeout() -> tuple[str, float]:
            return ('', oldest) if oldest else (setting, getattr(self._node.values, setting))

        self._words[name] = words
        merge = {'rollers': self._merge, 'pressures': self._merge_pressures}.get(name)
        every = merge is not None or take is not None
        taken = receive if merge is None else partial(merge, receive)
        label = words.replace(' ', '_')
        gate = Gate(self._node, kind, topic, label, read, taken, timeout, every)
        self._gates[name] = gate
        return gate.subscription

    def _merge(self, receive: Receive, received: StampedInput | RejectedInput) -> None:
        """Merge messages of single rollers to a state of all, and add the estimated offsets."""
        if isinstance(received, StampedInput):
            self._parts.take(received.value, received.time, self._node.now())
            received = self._parts.merged()
        estimate = self._latest('estimate') if 'estimate' in self._gates else None
        if isinstance(estimate, StampedInput):
            self._offsets = estimate.value.offsets
        if isinstance(received, StampedInput):
            positions, velocities, _ = received.value
            state = RollerState(positions + self._offsets, velocities, self._offsets)
            received = received._replace(value=state)
        receive(received)

    def keep_encoders(self, take: Take | None = None) -> None:
        """
        Store encoder readings from `joint_states` as the input `rollers`, without offsets.

        :param take: callback, see `keep`.
        """
        read = partial(read_roller_part, names=self._robot.roller_names)
        self.keep(JointState, 'joint_states', read, 'rollers', stops=True, take=take)

    def keep_joint_states(self) -> None:
        """
        Store the roller state from `joint_states` as the input `rollers`, with estimated offsets.

        If a node publishes `state_estimate`, the message is stored as the input `estimate`, and
        its offsets are added to the roller positions. The last received offsets remain valid
        without a timeout.
        """
        self.keep_encoders()
        read = partial(read_estimate, robot=self._robot)
        self.keep(StateEstimate, 'state_estimate', read, 'estimate')

    def keep_object_pose(self, **options: Any) -> None:
        """
        Store the object's pose from `object_pose` as the input `pose`; see `RobotFrame`.

        :param options: options of `keep`.
        """
        self.keep(PoseStamped, 'object_pose', self._frame.read_pose, 'pose', **options)

    def keep_joint_markers(self, **options: Any) -> None:
        """
        Store measured joint positions {name: (x, y)} [m] from `joint_markers` as input `markers`.

        :param options: options of `keep`.
        """
        read = self._frame.read_markers
        self.keep(MultiDOFJointState, 'joint_markers', read, 'markers', **options)

    def keep_held_grip(self) -> None:
        """Store the `GripRecord` of the held object from `manipulation/grip` as `held_grip`."""
        read = partial(read_grip, robot=self._robot)
        self.keep(HeldGrip, 'manipulation/grip', read, 'held_grip')

    @functools.cached_property
    def _frame(self) -> RobotFrame:
        return RobotFrame.heard_by(self._node, self._robot)

    def keep_tube_pressures(self) -> None:
        """
        Store gauge pressures (t,) [Pa] from `tube_pressures` as the input `pressures`.

        Each message has the pressure of one tube. The input is valid once a message of each tube
        has arrived; its stamp is the oldest stamp of these messages. The parameter
        `ambient_pressure` is subtracted.
        """

        def read(message: FluidPressure) -> tuple[str, float]:
            return read_tube_pressure(message, self._robot, self._node.values.ambient_pressure)

        self.keep(FluidPressure, 'tube_pressures', read, 'pressures')

    def _merge_pressures(self, receive: Receive, received: StampedInput | RejectedInput) -> None:
        """Add the pressure of one tube to the pressures of all tubes."""
        now = self._node.now()
        if isinstance(received, RejectedInput):
            self._bad_pressure = received, now
        else:
            tube, pressure = received.value
            kept = self._pressures.get(tube)
            self._pressures[tube] = keep_latest(kept, received._replace(value=pressure), now)
            known = [self._pressures.get(name) for name in self._robot.description.pressures]
            if not all(known):
                return
            time = min(each.time for each in known)
            # The tube is unknown: possibly the one with the oldest stamp.
            bad, when = self._bad_pressure
            reason = bad if time < when else None
            received = StampedInput(tuple(each.value for each in known), time, reason)
        receive(received)

    def settle(self) -> None:
        """Process the queued messages whose transforms have arrived."""
        for gate in self._gates.values():
            gate.settle()

    def clear(self) -> None:
        """Discard all inputs, because their ages are unknown after a jump of the clock."""
        self._parts.clear()
        self._pressures.clear()
        for name, gate in self._gates.items():
            gate.clear()
            known = self._latest(name) is not None
            self._store(name, None)
            if name == 'pressures' and known:  # not replaced by the pressures of the robot file
                why = 'tube pressures: none since the clock jumped or stopped'
                self._store(name, RejectedInput(why))

    def describe_ages(self) -> dict[str, object]:
        """Return the age of each input [s], or the reason why it is missing."""
        ages = {}
        for name, words in self._words.items():
            given = self._latest(name)
            if isinstance(given, StampedInput):
                age = f'{self._node.now() - given.time:.4f}'
            else:
                age = 'none received' if given is None else given.reason
            ages[f'age of {words} [s]'] = age
        return ages  # type: ignore[return-value]


class TrackedShape:
    """
    Configuration of the robot, tracked from joint states.

    :ivar timeout: largest age of an input [s].
    :ivar estimate: input of the `EstimatedTravel` with the roller offsets; None without an
        estimate.
    :param robot: the robot, whose home is the initial guess of the first configuration.
    :param timeout: largest age of an input [s].
    """

    def __init__(self, robot: Robot, timeout: float) -> None:
        self.timeout = timeout
        self.rollers: Input = None  #: latest joint states, a StampedInput of a RollerState
        self.estimate: Input = None
        self._shapes = ConfigurationTracker(robot.home)
        self._tracked: Input = None

    def track(self) -> None:
        """Update the configuration from the latest joint states."""
        if self.rollers is self._tracked:
            return
        self._tracked = self.rollers
        if isinstance(self.rollers, StampedInput):
            # The next request raises the error.
            with contextlib.suppress(ConfigurationError):
                self._shapes.configuration(self.rollers.value.positions)

    def configuration(self, now: float) -> Configuration:
        """
        Return the configuration at the latest joint states.

        :param now: time on the clock of the inputs [s].
        :raises InputError: the joint states are missing, stale or invalid.
        :raises ConfigurationError: no configuration exists at these roller positions.
        """
        (given,) = require_fresh(now, self.timeout, joint_states=self.rollers)
        return self._shapes.configuration(given.value.positions)
