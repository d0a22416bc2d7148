"""How far a shape is from those that it could not come back from, in one call."""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.clearance import bodies
from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.grasp_analysis import Cylinder
from isotruss_ros.core.shape_rigidity import shape_rigidity
import numpy as np


class ShapeMargins(NamedTuple):
    """
    What is left between a shape and trouble.

    :ivar rigidity: see `shape_rigidity`: 1 at home, 0 where the locked robot is a mechanism.
    :ivar clearance: the smallest distance between parts of the robot that must not meet, between
        surfaces [m], negative where they overlap; see `clearance`.
    :ivar object_clearance: that between the robot and the object away from the grip; inf where
        there is no object, or nothing away from it.
    :ivar nearest: the parts at `clearance`, in words.
    :ivar nearest_to_object: the part at `object_clearance`, in words.
    """

    rigidity: float
    clearance: float
    object_clearance: float
    nearest: str
    nearest_to_object: str


def shape_margins(
    config: Configuration, cylinder: Cylinder | None = None, grip: str | None = None
) -> ShapeMargins:
    """
    Tell how far a shape is from losing its rigidity, crossing itself or pushing an object.

    :param config: where the robot is.
    :param cylinder: an object in the plane of the robot.
    :param grip: the module `t/j` that holds the object: nothing that meets at its joint counts.
        None for an object that lies free: everything counts.
    :raises GraspError: the robot has no such module.
    """
    try:
        rigidity = float(shape_rigidity(config.robot).modes(config).values[0])
    except ConfigurationError:
        rigidity = 0.0
    parts = bodies(config.robot)
    clearance, nearest = float('inf'), ''
    distances = parts.distances(config)
    if len(distances):
        least = int(distances.argmin())
        clearance, (nearest,) = float(distances[least]), parts.names([least])
    if cylinder is None:
        return ShapeMargins(rigidity, clearance, float('inf'), nearest, '')
    distances = parts.object_distances(config, cylinder, grip)
    least = int(distances.argmin())
    part = parts.object_names()[least] if distances[least] < np.inf else ''
    return ShapeMargins(rigidity, clearance, float(distances[least]), nearest, part)
