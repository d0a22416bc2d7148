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
from isotruss_ros.core.model.pose import Cylinder
from isotruss_ros.core.model.segment_gaps import segment_gaps
from isotruss_ros.core.model.shapes import Disc
from isotruss_ros.core.numerics.arrays import Array
import numpy as np


def member_depths(config: Configuration, body: Cylinder | ConvexObject) -> Array:
    """
    Return how deep an object is in each undeformed member, negative where apart (m,) [m].

    :param config: configuration of the robot.
    :param body: the object in its place.
    """
    topology, points = config.robot.topology, config.points
    radius = 0.5 * config.robot.description.tube_diameter
    if isinstance(body, Cylinder) or isinstance(body.shape, Disc):
        return radius - _gaps_of_disc(config, body)
    starts, ends = points[topology.b], points[topology.c[topology.following]]
    return radius - segment_gaps(body, starts, ends).gaps


def _gaps_of_disc(config: Configuration, body: Cylinder | ConvexObject) -> Array:
    """Return what `segment_gaps` does for a disc: the gaps (m,) to the members [m]."""
    m = config.robot.topology.n_modules
    if isinstance(body, Cylinder):
        center, size = complex(*body.center), body.diameter
    else:
        center, size = body.center, body.shape.diameter
    lengths = config.member_lengths
    away = (center - config.points[config.robot.topology.b]) * config.spans[:m].conj() / lengths
    beyond = away.real - away.real.clip(0.0, lengths)
    return np.hypot(away.imag, beyond) - 0.5 * size
