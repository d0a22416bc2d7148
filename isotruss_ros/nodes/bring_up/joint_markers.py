# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joints of the robot as a tracker measures them, from the topic `joint_markers`."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

from isotruss_ros.calibration.home_fit import Posture
from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.core import Robot
from isotruss_ros.core.inputs import (
    Input,
    InputError,
    require_fresh,
    StampedInput,
    Timeline,
)
from isotruss_ros.nodes.framework.parameters import Spec
from isotruss_ros.nodes.framework.runner import StoppableNode
from isotruss_ros.nodes.framework.sensors import Inputs
import numpy as np

#: Markers are averaged over this time: 1 mm of noise tells a stiffness scale to 5 % [s].
WINDOW = 1.0
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
    count: int  # type: ignore[assignment]


class JointMarkers:
    """
    The messages of `joint_markers` and `joint_states` of the last while.

    :ivar frame: of the robot, in which the joints are.
    :ivar timeout: largest age of an input [s].
    :ivar rollers: input of the `RollerState`.
    :ivar markers: input of the joints {name: (x, y)} [m].
    :param node: subscribes.
    :param robot: whose joints and rollers they are.
    """

    def __init__(self, node: StoppableNode, robot: Robot) -> None:
        self.timeout = LATEST
        self.rollers: Input = None
        self.markers: Input = None
        self._rollers, self._markers = Timeline(), Timeline()
        self._inputs = Inputs(node, robot, self, '')
        self.frame = self._inputs.frame
        self._inputs.keep_encoders(take=partial(self._take, self._rollers))
        self._inputs.keep_joint_markers(take=partial(self._take, self._markers))

    def measure(self, now: float) -> MeasuredJoints:
        """
        Return means over the window.

        :param now: time on the clock of the stamps [s].
        :raises MeasurementError: a topic is silent, or the rollers turn.
        """
        self._inputs.settle()
        try:
            require_fresh(now, LATEST, '', joint_states=self.rollers, joint_markers=self.markers)
        except InputError as error:
            raise MeasurementError(str(error)) from error
        readings = np.array([state.positions for state in self._rollers.values])
        if np.ptp(readings, axis=0).max() > STILL:
            raise MeasurementError('the rollers turn: joints are measured while they stand still')
        seen: dict[str, list[tuple[float, float]]] = {}
        for joints in self._markers.values:
            for name, place in joints.items():  # type: ignore[union-attr]
                seen.setdefault(name, []).append(place)
        means = {name: tuple(np.mean(places, axis=0).tolist()) for name, places in seen.items()}
        least = min(map(len, seen.values()))
        return MeasuredJoints(Posture(readings.mean(axis=0), means), least)

    def _take(self, kept: Timeline, given: StampedInput) -> None:
        kept.add(given.time, given.value)
        kept.discard_before(kept.last[0] - WINDOW)
