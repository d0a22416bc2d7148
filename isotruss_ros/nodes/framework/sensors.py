# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The measured inputs of a node; of each the newest value is kept, or why it was rejected."""

from __future__ import annotations

from collections.abc import Callable
import contextlib
import functools
from functools import partial
import math
from typing import Any

from geometry_msgs.msg import PoseStamped
from isotruss_msgs.msg import StateEstimate
from isotruss_ros.core import Configuration, Robot
from isotruss_ros.core.control.inputs import (
    Input,
    keep_latest,
    RejectedInput,
    require_fresh,
    RollerState,
    StampedInput,
)
from isotruss_ros.core.control.roller_parts import RollerParts
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.kinematics.configuration import ConfigurationTracker
from isotruss_ros.nodes.conversions.estimate_messages import read_estimate
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

#: Called with an input.
Take = Callable[[StampedInput], None]


class Inputs:
    """
    Subscriptions of a node; what decides by the inputs gets each as an attribute.

    That is a StampedInput, by the clock of the node where messages have no header, or a
    RejectedInput with the reason; each message passes a `Gate`.

    :param node: subscribes.
    :param robot: whose rollers, tubes and frame messages must have.
    :param holder: gets the inputs; its `timeout` is the largest age of an input [s], and its
        `pressure_timeout` that of pressures.
    :param setting: name of the timeout; empty where no parameter sets it.
    """

    def __init__(
        self, node: StoppableNode, robot: Robot, holder: Any, setting: str = 'command_timeout'
    ) -> None:
        self._node, self._robot, self._holder = node, robot, holder
        self._setting = setting
        self._gates: dict[str, Gate] = {}
        #: What each attribute is, in words.
        self._words: dict[str, str] = {}
        self._parts = RollerParts(robot.roller_names)
        self._offsets = np.zeros(len(robot.roller_names))
        self._pressures: dict[str, Input] = {}
        #: The last pressure that was rejected, and when [s].
        self._bad_pressure: tuple[RejectedInput | None, float] = None, -math.inf

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
        Subscribe to an input.

        :param kind: type of the messages.
        :param topic: relative name of the topic.
        :param read: returns the value of a message, None for no input; raises MessageError for one
            that is unusable.
        :param name: attribute of the holder.
        :param words: what it is, for the diagnostics; the topic if left out.
        :param stops: whether an invalid message erases the input, and so stops the robot at once;
            the one before counts on if not.
        :param take: called with each StampedInput, not only the newest, whatever their order is;
            None for nothing.
        :param oldest: largest age [s]; that of the holder if None.
        """
        words = words or topic.replace('_', ' ').replace('/', ' ')
        holder = self._holder

        def receive(received: StampedInput | RejectedInput) -> None:
            valid = isinstance(received, StampedInput)
            erased = stops and not valid and received.fault == 'INVALID'
            kept = None if erased else getattr(holder, name)
            setattr(holder, name, keep_latest(kept, received, self._node.now()))
            if valid and take is not None:
                take(received)

        def timeout() -> tuple[str, float]:
            if name == 'pressures':
                return 'pressure_timeout', holder.pressure_timeout
            return ('', oldest) if oldest else (self._setting, holder.timeout)

        self._words[name] = words
        label, every = words.replace(' ', '_'), take is not None
        if name == 'rollers':
            receive, every = partial(self._merge, receive), True
        elif name == 'pressures':
            receive, every = partial(self._merge_pressures, receive), True
        gate = Gate(self._node, kind, topic, label, read, receive, timeout, every)
        self._gates[name] = gate
        return gate.subscription

    def _merge(
        self,
        receive: Callable[[StampedInput | RejectedInput], None],
        received: StampedInput | RejectedInput,
    ) -> None:
        """Pass on the state of all rollers in place of a part, with the estimated offsets."""
        if isinstance(received, StampedInput):
            self._parts.take(received.value, received.time, self._node.now())
            received = self._parts.merged()
        estimate = getattr(self._holder, 'estimate', None)
        if isinstance(estimate, StampedInput):
            self._offsets = estimate.value.offsets
        if isinstance(received, StampedInput):
            positions, velocities, _ = received.value
            state = RollerState(positions + self._offsets, velocities, self._offsets)
            received = received._replace(value=state)
        receive(received)

    def keep_encoders(self, take: Take | None = None) -> None:
        """
        Keep the RollerState as the encoders read it, from `joint_states`, as `rollers`.

        :param take: see `keep`.
        """
        read = partial(read_roller_part, names=self._robot.roller_names)
        self.keep(JointState, 'joint_states', read, 'rollers', stops=True, take=take)

    def keep_joint_states(self) -> None:
        """
        Keep the RollerState, from `joint_states`, as `rollers`.

        Where a node publishes `state_estimate`, its EstimatedTravel is `estimate`, and what it
        adds to the encoders is in the positions of the rollers: the last one stays, as zeros do.
        """
        self.keep_encoders()
        read = partial(read_estimate, robot=self._robot)
        self.keep(StateEstimate, 'state_estimate', read, 'estimate')

    def keep_object_pose(self, **options: Any) -> None:
        """
        Keep the `Pose` of the object, from `object_pose`, as `pose`; see `RobotFrame`.

        :param options: of `keep`.
        """
        frame = self.frame
        self.keep(PoseStamped, 'object_pose', frame.read_pose, 'pose', **options)

    def keep_joint_markers(self, **options: Any) -> None:
        """
        Keep the measured joints {name: (x, y)} [m], from `joint_markers`, as `markers`.

        :param options: of `keep`.
        """
        read = self.frame.read_markers
        self.keep(MultiDOFJointState, 'joint_markers', read, 'markers', **options)

    @functools.cached_property
    def frame(self) -> RobotFrame:
        """Return the robot's frame with the transforms that the node hears."""
        return RobotFrame.heard_by(self._node, self._robot)

    def keep_tube_pressures(self, ambient: Callable[[], float]) -> None:
        """
        Keep the gauge pressures (t,) [Pa], from `tube_pressures`, as `pressures`.

        Each message has one tube; they count once all are known, as old as the oldest.

        :param ambient: returns the pressure around the tubes, 0 where gauges measure against it
            [Pa].
        """

        def read(message: FluidPressure) -> tuple[str, float]:
            return read_tube_pressure(message, self._robot, ambient())

        self.keep(FluidPressure, 'tube_pressures', read, 'pressures')

    def _merge_pressures(
        self,
        receive: Callable[[StampedInput | RejectedInput], None],
        received: StampedInput | RejectedInput,
    ) -> None:
        """Pass on the pressures of all tubes in place of one."""
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
            # Whose tube that was is not known: of the one that is behind, perhaps.
            bad, when = self._bad_pressure
            reason = bad if time < when else None
            received = StampedInput(tuple(each.value for each in known), time, reason)
        receive(received)

    def settle(self) -> None:
        """Take in the messages whose transforms have come."""
        for gate in self._gates.values():
            gate.settle()

    def clear(self) -> None:
        """Discard the inputs: after a jump of the clock their ages are unknown."""
        self._parts.clear()
        self._pressures.clear()
        for name, gate in self._gates.items():
            gate.clear()
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
        return ages  # type: ignore[return-value]


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
