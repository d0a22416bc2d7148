# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Subscriptions that store the latest value of each input, or the reason for its rejection."""

from __future__ import annotations

from collections.abc import Callable
import contextlib
from functools import partial
from typing import Any

from geometry_msgs.msg import PoseStamped
from isotruss_msgs.msg import GraspState, HeldGrip, Obstacles, StateEstimate
from isotruss_ros.core import Configuration, Obstacle, Robot
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.inputs import (
    CLOCK_SKEW,
    ENDED_SHARE,
    Input,
    InputFault,
    LatestInputs,
    RejectedInput,
    require_accepted,
    require_fresh,
    RollerState,
    StampedInput,
)
from isotruss_ros.core.kinematics.configuration import ConfigurationTracker
from isotruss_ros.core.model.obstacle import MAX_OBSTACLES
from isotruss_ros.nodes.conversions.sensor_messages import read_roller_part, read_tube_pressure
from isotruss_ros.nodes.conversions.state_messages import read_estimate, read_grip
from isotruss_ros.nodes.framework.gate import ForeignMessage, Gate, Received, Topic
from isotruss_ros.nodes.framework.received_inputs import keep_latest, RollerParts
from isotruss_ros.nodes.framework.robot_frame import RobotFrame
from isotruss_ros.nodes.framework.runner import StoppableNode
import numpy as np
from rclpy.subscription import Subscription
from sensor_msgs.msg import FluidPressure, JointState, MultiDOFJointState


class Inputs(LatestInputs):
    """
    Latest inputs of a node, with the subscriptions that replace them.

    A `Gate` checks each message and converts it to a `StampedInput`, or to a `RejectedInput` with
    the reason. The following inputs are known by name:

    - `rollers` from `joint_states`, including the roller offsets of the input `estimate`. The last
      received offsets remain valid without a timeout.
    - `estimate` from `state_estimate`.
    - `pose` from `object_pose`, and `markers` from `joint_markers`, see `RobotFrame`.
    - `grasp` from `grasp/state`.
    - `held_grip` from `manipulation/grip`; an empty message discards the previous grip.
    - `obstacles` from `obstacles`. An obstacle that later messages do not contain remains with its
      last stamp, until it is cleared.
    - `pressures` from `tube_pressures`, available once a message for each tube has arrived. The
      stamp is the oldest one of these messages.

    :param robot: robot with the rollers, tubes and frame of the messages.
    :param oldest: largest age of an input [s]; None: the value of a parameter of the node.
    """

    def __init__(self, node: StoppableNode, robot: Robot, oldest: float | None = None) -> None:
        super().__init__()
        self._node, self._robot, self._oldest = node, robot, oldest
        self._gates: dict[str, Gate] = {}
        self._parts = RollerParts(robot.roller_names)
        self._offsets = np.zeros(len(robot.roller_names))
        self._by_tube: dict[str, Input] = {}
        self._by_name: dict[str, Obstacle] = {}
        self._frame: RobotFrame | None = None
        self._shapes, self._tracked = ConfigurationTracker(robot.home), self.rollers

    def keep(self, *names: str, **options: Any) -> None:
        """Subscribe to the topics of the named inputs."""
        for name in names:
            self.keep_topic(name, self._find_topic(name), **options)

    def keep_topic(
        self,
        name: str,
        topic: Topic,
        take: Callable[[StampedInput], None] | None = None,
        oldest: float | None = None,
    ) -> Subscription:
        """
        Subscribe to a topic, and store the value of the newest message as an input.

        :param take: callback that receives every value, even if its stamp is older than that of
            the stored value; None: no callback.
        :param oldest: largest age of this input [s]; None: the value for all inputs.
        """

        def receive(message: Received, now: float) -> None:
            if isinstance(message, ForeignMessage) and getattr(self, name) is not None:
                return
            received = message if topic.merge is None else topic.merge(message, now)
            if received is None:
                return
            valid = isinstance(received, StampedInput)
            erases = topic.stops and not valid and received.fault is InputFault.INVALID
            kept = None if erases else getattr(self, name)
            setattr(self, name, keep_latest(kept, received, now))
            if valid and take is not None:
                take(received)  # type: ignore[arg-type]

        every = topic.merge is not None or take is not None
        gate = Gate(self._node, topic, receive, oldest or self._oldest, every)
        self._gates[name] = gate
        return gate.subscription

    def _find_topic(self, name: str) -> Topic:
        """Return the topic of an input that is known by name."""
        node, robot = self._node, self._robot
        if name in ('pose', 'markers', 'obstacles') and self._frame is None:
            self._frame = RobotFrame.heard_by(node, robot)
        frame = self._frame or RobotFrame(robot)
        read_part = partial(read_roller_part, names=robot.roller_names)
        read_offsets = partial(read_estimate, robot=robot)
        read_held_grip = partial(read_grip, robot=robot)
        names = robot.roller_names
        topics = {
            'rollers': Topic(
                JointState,
                'joint_states',
                read_part,
                stops=True,
                merge=self._merge,
                parts=lambda message: {
                    name: (place,)
                    for name, place in zip(message.name, message.position, strict=False)
                    if name in names
                },
            ),
            'estimate': Topic(StateEstimate, 'state_estimate', read_offsets),
            'pose': Topic(
                PoseStamped,
                'object_pose',
                frame.read_pose,
                parts=lambda message: {'': (message.pose.position.x, message.pose.position.y)},
            ),
            'markers': Topic(
                MultiDOFJointState,
                'joint_markers',
                frame.read_markers,
                parts=lambda message: {
                    name: (place.translation.x, place.translation.y)
                    for name, place in zip(message.joint_names, message.transforms, strict=False)
                },
            ),
            'grasp': Topic(GraspState, 'grasp/state', lambda state: state),
            'held_grip': Topic(HeldGrip, 'manipulation/grip', read_held_grip, stops=True),
            'obstacles': Topic(
                Obstacles,
                'obstacles',
                frame.read_obstacles,
                timeout='obstacle_timeout',
                merge=self._merge_obstacles,
                parts=lambda message: {
                    entry.name: (entry.pose.position.x, entry.pose.position.y)
                    for entry in message.obstacles
                },
            ),
            'pressures': Topic(
                FluidPressure,
                'tube_pressures',
                lambda message: read_tube_pressure(message, robot, node.values.ambient_pressure),
                timeout='pressure_timeout',
                merge=self._merge_pressures,
                parts=lambda message: {message.header.frame_id: (message.fluid_pressure,)},
            ),
        }
        return topics[name]

    def _merge(self, received: Received, now: float) -> Received:
        """Merge messages of some rollers to the state of all, and add the estimated offsets."""
        if isinstance(received, StampedInput):
            self._parts.take(received.value, received.time, now)
            received = self._parts.merged()
        if isinstance(self.estimate, StampedInput):
            self._offsets = self.estimate.value.offsets
        if isinstance(received, StampedInput):
            positions, velocities, _ = received.value
            state = RollerState(positions + self._offsets, velocities, self._offsets)
            received = received._replace(value=state)
        return received

    def _merge_obstacles(self, received: Received, now: float) -> Received:
        """Merge a message of some moving obstacles with the last pose of the others."""
        if isinstance(received, RejectedInput):
            return received
        merged = dict(self._by_name)
        for obstacle in received.value:
            kept = merged.get(obstacle.name)
            if kept is None or kept.stamp > now + CLOCK_SKEW or kept.stamp <= obstacle.stamp:
                merged[obstacle.name] = obstacle
        if len(merged) > MAX_OBSTACLES:  # names that have ended leave
            oldest = now - ENDED_SHARE * self._node.values.obstacle_timeout
            merged = {name: kept for name, kept in merged.items() if kept.stamp >= oldest}
        if len(merged) > MAX_OBSTACLES:
            return RejectedInput(
                f'obstacles: {len(merged)} names in the messages; must be at most {MAX_OBSTACLES}'
            )
        self._by_name = merged
        return received._replace(value=tuple(merged.values()))

    def clear_obstacles(self) -> str:
        """Discard all moving obstacles until the next message; return a text with their names."""
        names = ', '.join(self._by_name) or 'none'
        self._by_name.clear()
        self.obstacles = None
        return f'cleared moving obstacles: {names}'

    def present_obstacles(self, now: float) -> tuple[Obstacle, ...]:
        """
        Return the moving obstacles at rest at their present poses, for plans.

        An obstacle that is older than `obstacle_timeout` stops the rollers until it is published
        again or cleared, so plans leave it out.

        :raises InputError: the obstacles are unknown.
        """
        received = require_accepted('obstacles', self.obstacles)
        if received is None:
            return ()
        oldest = self._node.values.obstacle_timeout
        fresh = (obstacle.at(now) for obstacle in received.value if now - obstacle.stamp <= oldest)
        return tuple(Obstacle(obstacle.name, obstacle.body) for obstacle in fresh)

    def _merge_pressures(self, received: Received, now: float) -> Received | None:
        """Merge the pressure of one tube with the pressures of the other tubes."""
        if isinstance(received, RejectedInput):
            return received
        tube, pressure = received.value
        kept = self._by_tube.get(tube)
        self._by_tube[tube] = keep_latest(kept, received._replace(value=pressure), now)
        known = [self._by_tube.get(name) for name in self._robot.description.pressures]
        if not all(known):
            return None
        time, before = min(latest.time for latest in known), self.pressures
        # The tube of a rejected message is unknown: possibly the one with the oldest stamp.
        same = isinstance(before, StampedInput) and before.time == time
        values = tuple(latest.value for latest in known)
        return StampedInput(values, time, before.rejected if same else None)

    def settle(self) -> None:
        """Process the queued messages of all inputs whose transforms have arrived."""
        for gate in self._gates.values():
            if gate.waiting:
                gate.settle()

    def clear(self) -> None:
        """Discard all inputs, because their ages are unknown after a jump of the clock."""
        self._parts.clear()
        self._by_tube.clear()
        self._by_name.clear()
        for name, gate in self._gates.items():
            gate.waiting.clear()
            known = getattr(self, name) is not None
            setattr(self, name, None)
            if name == 'pressures' and known:  # not replaced by the pressures of the robot file
                why = 'tube pressures: none since the clock jumped or stopped'
                self.pressures = RejectedInput(why)
            elif name == 'obstacles' and known:  # they may still be there
                why = 'obstacles: none since the clock jumped or stopped'
                self.obstacles = RejectedInput(why)

    @property
    def conflicts(self) -> str:
        """Return a text about inputs that several publishers send; empty without such inputs."""
        return '; '.join(filter(None, (gate.conflict for gate in self._gates.values())))

    def describe_ages(self) -> dict[str, object]:
        """Return the age of each input [s] or the reason why it is missing, and conflicts."""
        ages: dict[str, object] = {'conflicting publishers': self.conflicts or 'none'}
        for name, gate in self._gates.items():
            latest = getattr(self, name)
            if isinstance(latest, StampedInput):
                age = f'{self._node.now() - latest.time:.4f}'
            else:
                age = 'none received' if latest is None else latest.reason
            ages[f'age of {gate.words} [s]'] = age
        return ages

    def track(self) -> None:
        """Track the configuration by the latest joint states, if they are new."""
        if self.rollers is self._tracked:
            return
        self._tracked = self.rollers
        if isinstance(self.rollers, StampedInput):
            # The next request raises the error.
            with contextlib.suppress(ConfigurationError):
                self._shapes.configuration(self.rollers.value.positions)

    def configuration(self, now: float) -> Configuration:
        """Return the robot's configuration at the latest joint states."""
        timeout = self._node.values.command_timeout
        (rollers,) = require_fresh(now, timeout, joint_states=self.rollers)
        return self._shapes.configuration(rollers.value.positions)
