# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joints of the robot as a tracker measures them, from the topic `joint_markers`."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from isotruss_ros.calibration.home_fit import Posture
from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.core import Robot
from isotruss_ros.core.control.inputs import Timeline
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.nodes.conversions.joint_state_messages import read_roller_state
from isotruss_ros.nodes.conversions.messages import MessageError, read_stamp
from isotruss_ros.nodes.framework.parameters import Spec
from isotruss_ros.nodes.framework.robot_frame import RobotFrame
from isotruss_ros.nodes.framework.topics import RELIABLE
import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import JointState, MultiDOFJointState

WINDOW = Spec('window', 1.0, 'Markers are averaged over so long a time [s]', bounds=(0.05, 60.0))
DEVIATION = Spec(
    'marker_deviation',
    0.001,
    'Standard deviation of a coordinate of a marker [m]',
    bounds=(1e-6, 0.1),
)
#: Rollers whose encoders change by less than this in the window stand still [m].
STILL = 5e-4
#: Topics that say nothing for longer than this are not live [s].
LATEST = 0.5


class MeasuredJoints(NamedTuple):
    """
    Joints of a robot whose rollers stand still.

    :ivar posture: readings of the encoders, and means of the joints.
    :ivar count: least number of messages that a joint was in.
    """

    posture: Posture
    count: int


class JointMarkers:
    """
    The messages of `joint_markers` and `joint_states` of the last while.

    :ivar frame: of the robot, in which the joints are.
    :param node: subscribes.
    :param robot: whose joints and rollers they are.
    :param window: for so long they are kept [s].
    """

    def __init__(self, node: Node, robot: Robot, window: float) -> None:
        self._window = window
        self.frame = RobotFrame.heard_by(node, robot)
        self._markers, self._rollers = Timeline(), Timeline()
        #: Why the last message that is not usable is none; empty before.
        self._last_error = ''

        def read_travel(message: JointState) -> Array:
            return read_roller_state(message, robot.roller_names).positions

        for kind, topic, kept, reader in (
            (MultiDOFJointState, 'joint_markers', self._markers, self.frame.read_markers),
            (JointState, 'joint_states', self._rollers, read_travel),
        ):
            take = partial(self._take, kept, reader)
            node.create_subscription(kind, topic, take, RELIABLE)

    def measure(self, now: float) -> MeasuredJoints:
        """
        Return means over the window.

        :param now: time on the clock of the stamps [s].
        :raises MeasurementError: a topic is silent, or the rollers turn.
        """
        for topic, kept in (('joint_states', self._rollers), ('joint_markers', self._markers)):
            if not kept or now - kept.last[0] > LATEST:
                why = f': {self._last_error}' if self._last_error else ''
                raise MeasurementError(f'no {topic} in the last {LATEST:g} s{why}')
        readings = np.array(self._rollers.values)
        if np.ptp(readings, axis=0).max() > STILL:
            raise MeasurementError('the rollers turn: joints are measured while they stand still')
        seen: dict[str, list[tuple[float, float]]] = {}
        for joints in self._markers.values:
            for name, place in joints.items():
                seen.setdefault(name, []).append(place)
        means = {name: tuple(np.mean(places, axis=0).tolist()) for name, places in seen.items()}
        least = min(map(len, seen.values()))
        return MeasuredJoints(Posture(readings.mean(axis=0), means), least)

    def _take(self, kept: Timeline, read: Callable[[Any], Any], message: Any) -> None:
        try:
            kept.add(read_stamp(message.header), read(message))
        except MessageError as error:
            self._last_error = str(error)
            return
        kept.discard_before(kept.last[0] - self._window)
