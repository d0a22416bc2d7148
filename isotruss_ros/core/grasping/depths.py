"""How deep an object is in members as they are without load."""

from __future__ import annotations

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import as_convex_object, ConvexObject
from isotruss_ros.core.model.objects import Cylinder
from isotruss_ros.core.model.segment_gaps import segment_gaps
from isotruss_ros.core.numerics.arrays import Array


def member_depths(config: Configuration, body: Cylinder | ConvexObject) -> Array:
    """
    Return how deep an object is in each undeformed member, negative where apart (m,) [m].

    :param config: configuration of the robot.
    :param body: the object in its place.
    """
    topology, points = config.robot.topology, config.points
    starts, ends = points[topology.b], points[topology.c[topology.following]]
    radius = 0.5 * config.robot.description.tube_diameter
    return radius - segment_gaps(as_convex_object(body), starts, ends).gaps
