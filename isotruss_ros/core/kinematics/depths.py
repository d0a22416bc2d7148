# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""How deep an object is in members as they are without load."""

from __future__ import annotations

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.segment_gaps import segment_gaps
from isotruss_ros.core.numerics.arrays import Array
import numpy as np


def member_depths(config: Configuration, body: ConvexObject) -> Array:
    """
    Return how deep an object is in each undeformed member, negative where apart (m,) [m].

    :param config: configuration of the robot.
    :param body: the object in its place.
    """
    topology, points = config.robot.topology, config.points
    radius = 0.5 * config.robot.description.tube_diameter
    starts, ends = points[topology.b], points[topology.c[topology.following]]
    if body.shape.is_round:
        # The same as below, in a fifth of the time: what is nearest is nearest to the centre.
        spans = ends - starts
        shares = np.clip(((body.center - starts) / spans).real, 0.0, 1.0)
        return radius + body.shape.reach - np.abs(starts + shares * spans - body.center)
    return radius - segment_gaps(body, starts, ends).gaps
