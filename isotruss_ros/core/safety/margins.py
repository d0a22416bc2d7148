# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Distances of a configuration from singularity and from collisions."""

from __future__ import annotations

import functools
from typing import NamedTuple

from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.distances import BentParts, collision_model
from isotruss_ros.core.kinematics.rigidity import rigidity_index
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.grip import find_members
from isotruss_ros.core.model.convex_object import ConvexObject, SegmentGaps
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.numerics.blas_threads import single_threaded
import numpy as np


class ShapeMargins(NamedTuple):
    """Distances of a configuration from singularity and from collisions."""

    rigidity: float  #: rigidity index, 1 at home, 0 at a singular configuration
    #: smallest distance between the surfaces of two parts of the robot [m], negative for an
    #: overlap; see `CollisionModel`
    clearance: float
    nearest: str  #: names of the two parts whose distance is `clearance`


@single_threaded
def shape_margins(config: Configuration) -> ShapeMargins:
    """Return the distances of a configuration from singularity and from self-collisions."""
    try:
        rigidity = float(rigidity_index(config.robot).modes(config).values[0])
    except ConfigurationError:
        rigidity = 0.0
    model = collision_model(config.robot)
    distances = model.distances(config)
    closest = int(distances.argmin())
    return ShapeMargins(rigidity, float(distances[closest]), *model.names(np.array([closest])))


def object_distances(
    config: Configuration,
    body: ConvexObject,
    members: tuple[str, ...] = (),
    far: float = np.inf,
    parts: Indices | slice = slice(None),
) -> Array:
    """
    Return the distances (k,) between an object and parts of the robot, members, modules, rods [m].

    They are infinite for the grasping `members`, a module at which two of them meet, and the rods
    at its joint. Above `far` [m] a lower bound may be returned instead.
    """
    return object_gaps(config, body, members, far, parts).gaps


def object_gaps(
    config: Configuration,
    body: ConvexObject,
    members: tuple[str, ...],
    far: float,
    parts: Indices | slice,
    bent: BentParts | None = None,
) -> SegmentGaps:
    """Return `object_distances` with their directions, which are exact for distances to `far`."""
    model = collision_model(config.robot)
    lines, radii = model.lines(config, parts, bent), model.part_radii[parts]
    # The object's enclosing circle gives lower bounds. Those below `far` are made exact.
    nearest = lines.nearest_to(np.full(len(radii), body.center))
    distances = nearest.gaps - body.shape.reach - radii
    close = np.flatnonzero(distances < far)
    if len(close):
        gaps, nearest.normals[close], nearest.shares[close] = lines.take(close).gaps_to(body)
        distances[close] = gaps - radii[close]
    distances[_mask_grip(config.robot, members)[parts]] = np.inf
    return nearest._replace(gaps=distances)


@functools.lru_cache(maxsize=64)
def _mask_grip(robot: Robot, members: tuple[str, ...]) -> Array:
    """Return a mask (3m,) of the parts that `object_distances` excludes."""
    topology, grasping = robot.topology, find_members(robot.topology, members).members
    # The parts are the members, the modules at their starts, and the modules' rods.
    excludes_member, excludes_module = np.zeros((2, topology.n_modules), dtype=bool)
    excludes_member[grasping] = True
    # A grasping member that follows another one starts at the module at which the two meet.
    modules = np.intersect1d(topology.following[grasping], grasping)
    excludes_module[modules] = True
    excludes_rod = np.isin(topology.joint, topology.joint[modules])
    return np.concatenate([excludes_member, excludes_module, excludes_rod])
