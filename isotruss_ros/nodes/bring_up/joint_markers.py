# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joint positions measured by a tracker, from the topic `joint_markers`."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

from isotruss_ros.calibration.home_fit import Posture
from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.core import Robot
from isotruss_ros.core.inputs import InputError, require_fresh, StampedInput, Timeline
from isotruss_ros.nodes.framework.parameters import Spec
from isotruss_ros.nodes.framework.runner import StoppableNode
from isotruss_ros.nodes.framework.sensors import Inputs
import numpy as np

#: Averaging time of markers [s]. With it, marker noise of 1 mm causes an error of 5 % in the
#: stiffness scale.
AVERAGING_TIME = 1.0
MARKER_DEVIATION = Spec(
    'marker_deviation',
    0.001,
    'Standard deviation of a coordinate of a marker [m]',
    bounds=(1e-6, 0.1),
)
#: Largest change of an encoder reading within the averaging time at which its roller counts as at
#: rest [m].
REST_TOLERANCE = 5e-4
#: Largest age of the last message of a topic [s]; above it, the topic is regarded as silent.
MAX_TOPIC_AGE = 0.5


class MeasuredJoints(NamedTuple):
    """Measured joint positions of a robot with rollers at rest."""

    posture: Posture  #: mean encoder readings and joint positions
    #: smallest number of averaged messages of a joint
    count: int  # type: ignore[assignment]


class JointMarkers:
    """Recent messages of `joint_markers` and `joint_states`."""

    def __init__(self, node: StoppableNode, robot: Robot) -> None:
        self._recent = {'rollers': Timeline(), 'markers': Timeline()}
        self.inputs = Inputs(node, robot, oldest=MAX_TOPIC_AGE)
        for name in self._recent:
            self.inputs.keep(name, take=partial(self._take, name))

    def measure(self, now: float) -> MeasuredJoints:
        """Return the mean joint positions over the averaging time."""
        self.inputs.settle()
        try:
            rollers, markers = self.inputs.rollers, self.inputs.markers
            require_fresh(now, MAX_TOPIC_AGE, '', joint_states=rollers, joint_markers=markers)
        except InputError as error:
            raise MeasurementError(str(error)) from error
        readings = np.array([state.positions for state in self._recent['rollers'].values])
        change = float(np.ptp(readings, axis=0).max())
        if change > REST_TOLERANCE:
            raise MeasurementError(
                f'a roller moved by {1e3 * change:.2g} mm in {AVERAGING_TIME:g} s; must move by '
                f'at most {1e3 * REST_TOLERANCE:g} mm while joints are measured'
            )
        seen: dict[str, list[tuple[float, float]]] = {}
        for joints in self._recent['markers'].values:
            for name, place in joints.items():  # type: ignore[union-attr]
                seen.setdefault(name, []).append(place)
        means = {name: tuple(np.mean(places, axis=0).tolist()) for name, places in seen.items()}
        least = min(map(len, seen.values()))
        return MeasuredJoints(Posture(readings.mean(axis=0), means), least)

    def _take(self, name: str, sample: StampedInput) -> None:
        timeline = self._recent[name].added(sample.time, sample.value)
        self._recent[name] = timeline.since(sample.time - AVERAGING_TIME)
