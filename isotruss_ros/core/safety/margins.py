# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""How far a shape is from singular and self-colliding configurations, in one call."""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.rigidity import rigidity_index
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.safety.distances import collision_model
from isotruss_ros.core.safety.object_distances import object_distances
import numpy as np


class ShapeMargins(NamedTuple):
    """
    How far a shape is from singular and self-colliding configurations.

    :ivar rigidity: see `rigidity_index`: 1 at home, 0 where the locked robot is a mechanism.
    :ivar clearance: the smallest distance between parts of the robot that must not meet, between
        surfaces [m], negative where they overlap; see `CollisionModel`.
    :ivar object_clearance: that between the robot and the object away from the grip; inf where
        there is no object.
    :ivar nearest: the names of the parts at `clearance`.
    :ivar nearest_to_object: the name of the part at `object_clearance`, empty if there is none.
    """

    rigidity: float
    clearance: float
    object_clearance: float
    nearest: str
    nearest_to_object: str


@single_threaded
def shape_margins(
    config: Configuration, body: ConvexObject | None = None, members: tuple[str, ...] = ()
) -> ShapeMargins:
    """
    Measure how far a shape is from losing its rigidity, self-collision and pushing an object.

    :param config: where the robot is.
    :param body: an object in the plane of the robot; None for none.
    :param members: names of the members that hold the object: the parts that hold it do not count,
        see `object_distances`. None for a free object: everything counts.
    :raises GraspError: the robot has no such members.
    """
    try:
        rigidity = float(rigidity_index(config.robot).modes(config).values[0])
    except ConfigurationError:
        rigidity = 0.0
    model = collision_model(config.robot)
    distances = model.distances(config)
    least = int(distances.argmin())
    clearance, (nearest,) = float(distances[least]), model.names(np.array([least]))
    if body is None:
        return ShapeMargins(rigidity, clearance, float('inf'), nearest, '')
    distances = object_distances(config, body, members)
    least = int(distances.argmin())
    part = model.part_names()[least] if distances[least] < np.inf else ''
    return ShapeMargins(rigidity, clearance, float(distances[least]), nearest, part)
