# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""How the frame of a robot changes with its rollers and the pressure of its tubes."""

from __future__ import annotations

from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.statics.cut_frame import FrameRates
from isotruss_ros.core.statics.structure import (
    bisection_entries,
    bisection_spans,
    frame_layout,
    Structure,
)
import numpy as np


def structure_rates(structure: Structure, moved: Points, inflated: Array) -> FrameRates:
    """
    Return how a frame changes with p parameters.

    :param structure: the robot's frame.
    :param moved: (N, p) of the nodes of its configuration, x + iy [m].
    :param inflated: (t, p) of the gauge pressures of the tubes [Pa].
    """
    config, frame, robot = structure.config, structure.frame, structure.config.robot
    topology, b = robot.topology, frame_layout(robot).b
    start, end = topology.b, topology.c[topology.following]
    side, change = config.points[end] - config.points[start], moved[end] - moved[start]
    turned = change / side[:, None]
    points = np.empty((len(frame.points), moved.shape[1]), dtype=np.complex128)
    joints = len(topology.joint_names)
    points[:joints] = moved[:joints]
    points[b], points[b + 1] = moved[topology.b], moved[topology.c]
    # Guide rings stay at their distance from the pinch points; they turn with the side.
    ahead = 1j * turned.imag * (frame.points[b + 2] - frame.points[b])[:, None]
    points[b + 2] = points[b] + ahead
    points[b + 3] = points[b + 1] - ahead[topology.previous]
    pressures = np.array(structure.pressures)[topology.tube]
    by_length, by_pressure = structure.tube.flexibility_rates(config.member_lengths, pressures)
    longer = turned.real * np.abs(side)[:, None]
    of_tubes = by_length[:, :, None] * longer + by_pressure[:, :, None] * inflated[topology.tube]
    softer = np.zeros((3, 6, *longer.shape))
    softer[:, 3] = softer[:, 5] = of_tubes
    softer[:, 4] = of_tubes[:, topology.previous]
    spans = bisection_spans(robot, frame.points)[:, :, None].conj()
    turning = -1j * bisection_spans(robot, points).conj() / spans**2
    return FrameRates(points, softer.reshape(3, -1, moved.shape[1]), bisection_entries(turning))
