# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Distances between parts of a robot, and between the robot and an object.

Distances are between surfaces [m], negative for an overlap. There are three kinds of parts, with m
parts of each kind:

- a member is its tube from pinch point to pinch point, straight or, where the displacements of a
    bent robot are known (`BentParts`), with its bent centre line;
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
from typing import Any, NamedTuple

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.model.convex_object import ConvexObject, segment_gaps, SegmentGaps
from isotruss_ros.core.numerics.arrays import Array, as_xy, Indices, Points
from isotruss_ros.core.numerics.tolerances import COINCIDENCE
import numpy as np


class BentParts(NamedTuple):
    """Displacements of the parts of a bent robot from its configuration, at s points of each."""

    shares: Array  #: (3m, s) positions of the points on the parts' segments, from 0 to 1
    displacements: Points  #: (3m, s) displacements of these points [m]

    def at(self, parts: Indices, shares: Array) -> Points:
        """Return the displacements (k,) of parts at positions (k,) on their segments [m]."""
        places = zip(shares.tolist(), parts.tolist(), strict=True)
        values = [np.interp(x, self.shares[i], self.displacements[i]) for x, i in places]
        return np.array(values, dtype=np.complex128)


def find_bend_change(first: BentParts | None, second: BentParts | None) -> float:
    """Return the largest difference of the displacements of two states [m]; None: straight."""
    if first is second:
        return 0.0
    before, after = (0.0 if bent is None else bent.displacements for bent in (first, second))
    return float(np.abs(after - before).max())


#: Positions of the ends of a straight part.
STRAIGHT = np.array([0.0, 1.0])


class Polylines(NamedTuple):
    """Centre lines of k parts through s points each."""

    points: Points  #: (k, s) points [m]
    shares: Array  #: (k, s) positions of the points on the parts' segments

    def take(self, chosen: Indices) -> Polylines:
        """Return chosen lines."""
        return Polylines(self.points[chosen], self.shares[chosen])

    def nearest_to(self, points: Points) -> SegmentGaps:
        """Return the nearest points of the lines to k points, see `nearest_on_segment`."""
        starts, ends = self.points[:, :-1], self.points[:, 1:]
        return self._choose(SegmentGaps(*nearest_on_segment(points[:, None], starts, ends)))

    def gaps_to(self, body: ConvexObject) -> SegmentGaps:
        """Return the gaps (k,) between an object and the lines, see `segment_gaps`."""
        starts, ends = self.points[:, :-1], self.points[:, 1:]
        gaps = segment_gaps(body, starts.ravel(), ends.ravel())
        return self._choose(SegmentGaps(*(part.reshape(starts.shape) for part in gaps)))

    def gaps_to_each(self, bodies: Any) -> SegmentGaps:
        """Return the gaps (k,) between k `ObjectSamples` and the line of each."""
        return self._choose(segment_gaps(bodies, self.points[:, :-1], self.points[:, 1:]))

    def _choose(self, gaps: SegmentGaps) -> SegmentGaps:
        """Return the smallest of the gaps (k, s - 1) to the pieces of each line."""
        if self.points.shape[1] == 2:
            return SegmentGaps(*(part[:, 0] for part in gaps))
        pieces, lines = gaps.gaps.argmin(axis=1), np.arange(len(self.points))
        begin, end = self.shares[lines, pieces], self.shares[lines, pieces + 1]
        distances, normals, within = (part[lines, pieces] for part in gaps)
        return SegmentGaps(distances, normals, begin + within * (end - begin))


def nearest_on_segment(point: Points, start: Points, end: Points) -> tuple[Array, Points, Array]:
    """Return distances (k,) [m] and unit vectors from segments to points, and positions 0 to 1."""
    from_start, span = point - start, end - start
    squared_length = np.maximum(span.real**2 + span.imag**2, COINCIDENCE**2)
    shares = np.clip((span.conj() * from_start).real / squared_length, 0.0, 1.0)
    from_segment = from_start - shares * span
    distances = np.abs(from_segment)
    # The unit vector to a point on its segment is the segment's normal.
    normals = np.where(
        distances > COINCIDENCE,
        from_segment / np.maximum(distances, COINCIDENCE),
        1j * span / np.sqrt(squared_length),
    )
    return distances, normals, shares


def _middles(points: Points, nodes: Indices) -> Points:
    """Return the midpoints (k,) of pairs of nodes (2, k)."""
    return 0.5 * (points[nodes[0]] + points[nodes[1]])


def _add_midpoint_gradients(rows: Points, nodes: Indices, gradients: Points) -> None:
    """Add gradients (k,) by midpoints of node pairs (2, k) to k rows, half for each node."""
    row = np.arange(len(rows))
    for ends in nodes:
        rows[row, ends] += 0.5 * gradients


class CollisionModel:
    """Model of a robot's parts and of the pairs of parts that must not collide."""

    def __init__(self, robot: Mechanism) -> None:
        self._robot = robot
        topology, file = robot.topology, robot.description
        m, joints = topology.n_modules, np.arange(len(topology.joint_names))
        a, b, c, member_end = topology.joint, topology.b, topology.c, topology.end
        tube_radius = 0.5 * file.tube_diameter
        module_radius = 0.5 * file.module.pinch_separation + tube_radius
        # Parts are the segments of members, modules (of no length) and rods. A start or an end is
        # the midpoint of two nodes (2, 3m), which are the same at a joint or a member's end.
        self._start_nodes = np.array([[b, b, a], [b, c, a]]).reshape(2, -1)
        self._end_nodes = np.array([[member_end, b, b], [member_end, c, c]]).reshape(2, -1)
        self.part_radii = np.repeat([tube_radius, module_radius, 0.0], m)
        self.part_radii.flags.writeable = False
        # Points are modules and joints, also midpoints of two nodes (2, m + j).
        point_nodes = np.array([np.append(b, joints), np.append(c, joints)])
        point_radii = np.repeat([module_radius, 0.0], [m, len(joints)])
        self._pair_points, self._pair_parts = np.nonzero(_pair_mask(robot))
        # The parts that begin at these points: modules, and a rod of each joint.
        rods = 2 * m + np.array([np.flatnonzero(a == joint)[0] for joint in joints])
        self._pair_point_parts = np.append(m + np.arange(m), rods)[self._pair_points]
        self._pair_nodes = point_nodes[:, self._pair_points]
        self._pair_radii = point_radii[self._pair_points] + self.part_radii[self._pair_parts]

    def names(self, pairs: Indices) -> list[str]:
        """Return the names of pairs of parts, by the indices of the pairs."""
        modules, joints = self._robot.module_names, self._robot.topology.joint_names
        points = [f'module {name}' for name in modules] + [f'joint {name}' for name in joints]
        parts = self.part_names()
        return [f'{points[self._pair_points[i]]} and {parts[self._pair_parts[i]]}' for i in pairs]

    def part_names(self) -> list[str]:
        """Return the names (3m,) of the parts: first members, then modules, then rods."""
        return [
            *(f'member {name}' for name in self._robot.member_names),
            *(f'module {name}' for name in self._robot.module_names),
            *(f'rod {name}' for name in self._robot.module_names),
        ]

    def distances(
        self,
        config: Configuration,
        pairs: Indices | slice = slice(None),
        bent: BentParts | None = None,
    ) -> Array:
        """Return the distances between the surfaces of pairs of parts [m]."""
        return self.nearest(config, pairs, bent).gaps

    def nearest(
        self, config: Configuration, pairs: Indices | slice, bent: BentParts | None = None
    ) -> SegmentGaps:
        """Return the distances between the surfaces of pairs of parts, with their directions."""
        points = _middles(config.points, self._pair_nodes[:, pairs])
        if bent is not None:
            points = points + bent.displacements[self._pair_point_parts[pairs], 0]
        nearest = self.lines(config, self._pair_parts[pairs], bent).nearest_to(points)
        return nearest._replace(gaps=nearest.gaps - self._pair_radii[pairs])

    def gradients(
        self, config: Configuration, pairs: Indices, nearest: SegmentGaps | None = None
    ) -> Array:
        """Return the derivatives (k, 2n) of the pairs' distances by the node coordinates [-]."""
        _, normals, shares = nearest or self.nearest(config, pairs)
        rows = self.part_rows(config, self._pair_parts[pairs], shares, normals)
        _add_midpoint_gradients(rows, self._pair_nodes[:, pairs], normals)
        return rows.view(np.float64)

    def body_distances(
        self,
        config: Configuration,
        body: ConvexObject,
        parts: Indices | slice = slice(None),
        bent: BentParts | None = None,
    ) -> tuple[Array, Array, Array]:
        """Return distances (k,) of parts from an object [m], derivatives by nodes and twist."""
        nearest = self.lines(config, parts, bent).gaps_to(body)
        distances = nearest.gaps - self.part_radii[parts]
        return distances, *self.body_gradients(config, body, parts, nearest, bent)

    def body_gradients(
        self,
        config: Configuration,
        body: ConvexObject,
        parts: Indices | slice,
        nearest: SegmentGaps,
        bent: BentParts | None = None,
    ) -> tuple[Array, Array]:
        """Return the derivatives of the distances of k parts from an object by nodes and twist."""
        # The normals point from the object to the parts.
        rows = self.part_rows(config, parts, nearest.shares, -nearest.normals)
        # Moments of the normals about the object's origin; the nearest points of the segment and
        # of the surface are on the same line of action.
        arms = self.points_on(config, parts, nearest.shares, bent) - body.center
        moments = (nearest.normals.conj() * 1j * arms).real
        # Motion of the object along the normal shortens the distance.
        twist_rows = -np.column_stack([as_xy(nearest.normals), moments])
        return rows.view(np.float64), twist_rows

    def part_ends(
        self, config: Configuration, parts: Indices | slice = slice(None)
    ) -> tuple[Points, Points]:
        """Return the start points (k,) and end points (k,) of the parts' segments [m]."""
        starts = _middles(config.points, self._start_nodes[:, parts])
        return starts, _middles(config.points, self._end_nodes[:, parts])

    def lines(
        self,
        config: Configuration,
        parts: Indices | slice = slice(None),
        bent: BentParts | None = None,
    ) -> Polylines:
        """Return the centre lines of parts, straight or bent."""
        starts, ends = self.part_ends(config, parts)
        if bent is None:
            return Polylines(
                np.stack([starts, ends], axis=1), np.broadcast_to(STRAIGHT, (len(starts), 2))
            )
        shares = bent.shares[parts]
        straight = starts[:, None] + shares * (ends - starts)[:, None]
        return Polylines(straight + bent.displacements[parts], shares)

    def points_on(
        self,
        config: Configuration,
        parts: Indices | slice,
        shares: Array,
        bent: BentParts | None = None,
    ) -> Points:
        """Return the points (k,) of the centre lines of parts at positions (k,), x + iy [m]."""
        starts, ends = self.part_ends(config, parts)
        points = starts + shares * (ends - starts)
        if bent is None:
            return points
        return points + bent.at(np.arange(len(self.part_radii))[parts], shares)

    def part_rows(
        self, config: Configuration, parts: Indices | slice, shares: Array, normals: Points
    ) -> Points:
        """Return derivatives (k, n) of the distances of parts from fixed points by the nodes."""
        rows = np.zeros((len(shares), len(config.points)), dtype=np.complex128)
        _add_midpoint_gradients(rows, self._start_nodes[:, parts], -(1.0 - shares) * normals)
        _add_midpoint_gradients(rows, self._end_nodes[:, parts], -shares * normals)
        return rows


def _pair_mask(robot: Mechanism) -> Array:
    """Return the mask (m + j, 3m) of modules and joints with parts not connected to them."""
    topology = robot.topology
    m, j = topology.n_modules, len(topology.joint_names)
    # Columns: members, modules and rods, each numbered like its module.
    column = np.arange(m)
    start_joint = topology.joint
    # A member is connected to the modules at its ends, and a rod to the modules at its joint.
    module, joint_of_module = np.arange(m)[:, None], start_joint[:, None]
    with_members = (module != column) & (module != topology.following)
    with_modules = module < column  # each pair once
    with_rods = joint_of_module != start_joint
    module_rows = np.hstack([with_members, with_modules, with_rods])
    # A member and a rod are connected to the joints at their ends. The distance of a joint from a
    # module is not needed, because its rods end at the joint.
    joint = np.arange(j)[:, None]
    with_members = (joint != start_joint) & (joint != start_joint[topology.following])
    with_rods = joint != start_joint
    joint_rows = np.hstack([with_members, np.zeros((j, m), dtype=bool), with_rods])
    return np.concatenate([module_rows, joint_rows])


@functools.lru_cache(maxsize=16)
def collision_model(robot: Mechanism) -> CollisionModel:
    """Return the collision model of a robot, cached."""
    return CollisionModel(robot)
