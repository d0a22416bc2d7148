# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How far a shape is from singular and self-colliding configurations, in one call."""

from __future__ import annotations

import functools
from typing import NamedTuple

from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.distances import collision_model, nearest_on_segment
from isotruss_ros.core.kinematics.rigidity import rigidity_index
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.grip import find_members, Grip
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.model.convex_object import ConvexObject, segment_gaps
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.numerics.blas_threads import single_threaded
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


def object_distances(
    config: Configuration,
    body: ConvexObject,
    members: tuple[str, ...] = (),
    far: float = np.inf,
    parts: Indices | slice = slice(None),
) -> Array:
    """
    Return the distances between an object and the parts of the robot [m].

    :param config: where the robot is.
    :param body: the object in its place.
    :param members: names of the members that hold it; none where it is free. They are left out;
        and a module at which two of them meet with the rods at its joint.
    :param far: of parts that are certainly farther off the distance is a lower bound [m].
    :param parts: numbers of parts: members, modules, rods, m of each; all when left out.
    :return: (k,), inf for what is left out.
    :raises GraspError: no such members.
    """
    model = collision_model(config.robot)
    starts, ends = model.part_ends(config, parts)
    radii = model.part_radii[parts]
    # The circle that contains the object is no farther.
    distances = nearest_on_segment(body.center, starts, ends)[0] - body.shape.reach - radii
    near = np.flatnonzero(distances < far)
    if len(near):
        distances[near] = segment_gaps(body, starts[near], ends[near]).gaps - radii[near]
    distances[_left_out(config.robot, members)[parts]] = np.inf
    return distances


def grip_gradients(config: Configuration, grip: Grip, parts: Indices) -> tuple[Array, Array]:
    """
    Return how the distances of the object from some parts change.

    :param config: where the robot is.
    :param grip: what it holds; its contacts roll.
    :param parts: (k,) numbers of parts.
    :return: (k, 2n) rows on the node velocities, by which the parts move, and (k, r) rows on the
        roller speeds, by which the object does [-].
    :raises GraspError: see `find_contacts`.
    :raises ConfigurationError: the configuration is singular.
    """
    model = collision_model(config.robot)
    _, by_nodes, by_twist = model.body_distances(config, grip.body, parts)
    return by_nodes, by_twist @ grip_jacobian(config, grip)[:3]


@functools.lru_cache(maxsize=64)
def _left_out(robot: Robot, members: tuple[str, ...]) -> Array:
    """Return which parts (3m,) do not count."""
    topology, own = robot.topology, find_members(robot, members).members
    held = np.zeros((3, topology.n_modules), dtype=bool)
    held[0, own] = True
    # Where a member ends, the following one begins.
    meeting = np.intersect1d(topology.following[own], own)
    held[1, meeting] = True
    held[2] = np.isin(topology.joint, topology.joint[meeting])
    found = held.ravel()
    found.flags.writeable = False
    return found
