# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Distances between parts of a robot, and between the robot and an object.

Distances are between surfaces [m], negative for an overlap. There are three kinds of parts, with m
parts of each kind:

- a member is its straight tube from pinch point to pinch point;
- a module is a disc around the midpoint of its pinch points B and C, which contains the pinched
    tube: its radius is s/2 + tube radius;
- a rod is the straight line from that midpoint to the joint A. It has no thickness, so the
    required clearance must include half of its real thickness.

Each distance is the distance of a point from a segment, minus two radii. Two segments that do not
cross are nearest at an end of one of them. Every end is a joint, the midpoint of a module, or
inside the disc of a module. So the pairs are modules with members, rods and modules, and joints
with members and rods.

Pairs of connected parts are excluded: a member with the modules, rods and joints at its ends. Rods
that meet at a joint are kept apart by the distance of their modules.
"""

from __future__ import annotations

import functools

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.model.convex_object import ConvexObject, segment_gaps
from isotruss_ros.core.numerics.arrays import Array, as_xy, Indices, Points
from isotruss_ros.core.numerics.tolerances import COINCIDENCE
import numpy as np


def nearest_on_segment(point: Points, start: Points, end: Points) -> tuple[Array, Points, Array]:
    """Return distances (k,) [m], unit vectors to the points, positions along segments, 0 to 1."""
    from_start, span = point - start, end - start
    squares = np.maximum(span.real**2 + span.imag**2, COINCIDENCE**2)
    shares = np.clip((span.conj() * from_start).real / squares, 0.0, 1.0)
    from_segment = from_start - shares * span
    distances = np.abs(from_segment)
    # The vector to a point on the segment is the normal of the segment.
    normals = np.where(
        distances > COINCIDENCE,
        from_segment / np.maximum(distances, COINCIDENCE),
        1j * span / np.sqrt(squares),
    )
    return distances, normals, shares


def _middles(points: Points, nodes: Indices) -> Points:
    """Return the midpoints (k,) of pairs of nodes (2, k)."""
    return 0.5 * (points[nodes[0]] + points[nodes[1]])


def _add(rows: Points, nodes: Indices, gradients: Points) -> None:
    """Add to each row the gradient with respect to a midpoint: half to each of the two nodes."""
    row = np.arange(len(rows))
    for ends in nodes:
        rows[row, ends] += 0.5 * gradients


class CollisionModel:
    """Parts of a robot with radii (3m,) [m], and the pairs of parts that must not collide."""

    def __init__(self, robot: Mechanism) -> None:
        topology, file = robot.topology, robot.description
        m, joints = topology.n_modules, np.arange(len(topology.joint_names))
        tube = 0.5 * file.tube_diameter
        self._robot = robot
        disc = 0.5 * file.module.pinch_separation + tube
        a, b, c, member_end = topology.joint, topology.b, topology.c, topology.end
        # Segments between midpoints of two nodes: members, modules (of no length), rods.
        self._start = np.array([[b, b, a], [b, c, a]]).reshape(2, -1)
        self._end = np.array([[member_end, b, b], [member_end, c, c]]).reshape(2, -1)
        self.part_radii = np.repeat([tube, disc, 0.0], m)
        self.part_radii.flags.writeable = False
        # Points: modules, joints.
        points = np.array([np.append(b, joints), np.append(c, joints)])
        point_radius = np.repeat([disc, 0.0], [m, len(joints)])
        self._first, self._second = np.nonzero(_measured(robot))
        self._point = points[:, self._first]
        self._reach = point_radius[self._first] + self.part_radii[self._second]

    def names(self, pairs: Indices) -> list[str]:
        """Return a name for each of the given pairs of parts."""
        modules, joints = self._robot.module_names, self._robot.topology.joint_names
        points = [f'module {name}' for name in modules] + [f'joint {name}' for name in joints]
        segments = self.part_names()
        return [f'{points[self._first[i]]} and {segments[self._second[i]]}' for i in pairs]

    def part_names(self) -> list[str]:
        """Return the names (3m,) of the parts: first members, then modules, then rods."""
        return [
            *(f'member {name}' for name in self._robot.member_names),
            *(f'module {name}' for name in self._robot.module_names),
            *(f'rod {name}' for name in self._robot.module_names),
        ]

    def distances(self, config: Configuration, pairs: Indices | slice = slice(None)) -> Array:
        """Return the distances between the surfaces of pairs of parts [m]."""
        return self._nearest(config, pairs)[0] - self._reach[pairs]

    def gradients(self, config: Configuration, pairs: Indices) -> Array:
        """Return the derivatives (k, 2n) of the pairs' distances by the node coordinates [-]."""
        _, normals, shares = self._nearest(config, pairs)
        rows = self.part_rows(config, self._second[pairs], shares, normals)
        _add(rows, self._point[:, pairs], normals)
        return rows.view(np.float64)

    def body_distances(
        self, config: Configuration, body: ConvexObject, parts: Indices | slice = slice(None)
    ) -> tuple[Array, Array, Array]:
        """Return distances (k,) of parts [m], gradients by the nodes and the object's twist."""
        starts, ends = self.part_ends(config, parts)
        nearest = segment_gaps(body, starts, ends)
        rows = self.part_rows(config, parts, nearest.shares, -nearest.normals)
        # The moment arm is that of the nearest point of the segment; the surface point is on the
        # same line of action.
        arms = starts + nearest.shares * (ends - starts) - body.center
        turning = (nearest.normals.conj() * 1j * arms).real
        twist_rows = -np.column_stack([as_xy(nearest.normals), turning])
        return nearest.gaps - self.part_radii[parts], rows.view(np.float64), twist_rows

    def _nearest(
        self, config: Configuration, pairs: Indices | slice
    ) -> tuple[Array, Points, Array]:
        starts, ends = self.part_ends(config, self._second[pairs])
        return nearest_on_segment(_middles(config.points, self._point[:, pairs]), starts, ends)

    def part_ends(
        self, config: Configuration, parts: Indices | slice = slice(None)
    ) -> tuple[Points, Points]:
        """Return the start points (k,) and end points (k,) of the parts' segments [m]."""
        start, end = (
            _middles(config.points, nodes[:, parts]) for nodes in (self._start, self._end)
        )
        return start, end

    def part_rows(
        self, config: Configuration, parts: Indices | slice, shares: Array, normals: Points
    ) -> Points:
        """Return gradients (k, n) of distances from fixed points, see `nearest_on_segment` [-]."""
        rows = np.zeros((len(shares), len(config.points)), dtype=np.complex128)
        _add(rows, self._start[:, parts], -(1.0 - shares) * normals)
        _add(rows, self._end[:, parts], -shares * normals)
        return rows


def _measured(robot: Mechanism) -> Array:
    """Return a mask (m + j, 3m) of unconnected pairs: modules and joints with all parts."""
    topology = robot.topology
    m = topology.n_modules
    joint = np.concatenate([topology.joint, np.arange(len(topology.joint_names))])
    point, member = np.arange(len(joint))[:, None], np.arange(m)
    own_joint, next_joint = topology.joint, topology.joint[topology.following]
    # A member is fixed to the modules and joints at its ends, but not to other tubes there.
    of_members = np.where(
        point < m,
        (member != point) & (topology.following != point),
        (joint[:, None] != own_joint) & (joint[:, None] != next_joint),
    )
    of_modules = (point < m) & (point < member)
    of_rods = joint[:, None] != own_joint
    return np.hstack([of_members, of_modules, of_rods])


@functools.lru_cache(maxsize=16)
def collision_model(robot: Mechanism) -> CollisionModel:
    """Return the collision model of a robot, cached."""
    return CollisionModel(robot)
