# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Distances between parts of a robot that must not meet, and between the robot and an object.

Three kinds of parts, m of each; distances are between surfaces [m], negative where they overlap:

- a member is its straight tube from pinch point to pinch point;
- a module is a disc round the middle of its pinch points B and C that holds the pinched tube:
  radius s/2 + tube radius;
- a rod is the straight line from that middle to the joint A. It has no thickness: the least
  clearance that is asked for has to cover half of it.

All distances are those of a point with a radius from a straight segment with a radius. Two
segments that do not cross are nearest to each other at an end of one of them, and every end is the
middle of a module, a joint, or lies in the disc of a module. So it is enough to measure modules
from members, rods and modules, and joints from members and rods: members, or rods, then never come
closer to each other than their ends do.

Left out are parts that are fixed to each other: a member and the modules, the rods and the joints
at its ends. Rods that share a joint meet there; the modules at their other ends are measured from
each other, which keeps these rods apart too.
"""

from __future__ import annotations

import functools

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.model.convex_object import ConvexObject, segment_gaps
from isotruss_ros.core.numerics.arrays import Array, as_xy, Indices, Points
import numpy as np

#: Points closer than this are one [m]; it keeps directions between them finite.
TINY = 1e-12


def nearest_on_segment(point: Points, start: Points, end: Points) -> tuple[Array, Points, Array]:
    """
    Return the distances of points from straight segments, (k,) [m], and where these are nearest.

    :param point: (k,) or one for all [m].
    :param start: (k,) where the segments begin [m].
    :param end: (k,) where they end, perhaps where they begin [m].
    :return: distances; unit vectors (k,) from the segments toward the points, across a segment
        that a point is on; and where along the segments it is (k,), 0 to 1.
    """
    arm, along = point - start, end - start
    squares = np.maximum(along.real**2 + along.imag**2, TINY**2)
    shares = np.clip((along.conj() * arm).real / squares, 0.0, 1.0)
    away = arm - shares * along
    distances = np.abs(away)
    normals = np.where(
        distances > TINY, away / np.maximum(distances, TINY), 1j * along / np.sqrt(squares)
    )
    return distances, normals, shares


def _middles(points: Points, nodes: Indices) -> Points:
    """Return the points (k,) half way between two nodes each, (2, k)."""
    return 0.5 * (points[nodes[0]] + points[nodes[1]])


def _add(rows: Points, nodes: Indices, gradients: Points) -> None:
    """Add to each row what moving its point half way between two nodes is worth."""
    row = np.arange(len(rows))
    for own in nodes:
        rows[row, own] += 0.5 * gradients


class CollisionModel:
    """
    The parts of a robot, and the pairs of them that must not meet.

    :ivar part_radii: (3m,) of the parts around their segments [m]; not to be written to.
    :param robot: the robot.
    """

    def __init__(self, robot: Mechanism) -> None:
        topology, file = robot.topology, robot.description
        m, joints = topology.n_modules, np.arange(len(topology.joint_names))
        tube = 0.5 * file.tube_diameter
        self._robot = robot
        disc = 0.5 * file.module.pinch_separation + tube
        own_b, own_c, own_a = topology.b, topology.c, topology.joint
        next_c = topology.c[topology.following]
        # Segments: members, modules (of no length), rods.
        starts = [np.concatenate([own_b, own_b, own_a]), np.concatenate([own_b, own_c, own_a])]
        ends = [np.concatenate([next_c, own_b, own_b]), np.concatenate([next_c, own_c, own_c])]
        self._start, self._end = np.stack(starts), np.stack(ends)
        self.part_radii = np.repeat([tube, disc, 0.0], m)
        self.part_radii.flags.writeable = False
        # Points: modules, joints.
        points = [np.concatenate([own_b, joints]), np.concatenate([own_c, joints])]
        point_radius = np.repeat([disc, 0.0], [m, len(joints)])
        self._first, self._second = np.nonzero(_measured(robot))
        self._point = np.stack(points)[:, self._first]
        self._reach = point_radius[self._first] + self.part_radii[self._second]

    def names(self, pairs: Indices) -> list[str]:
        """
        Return the names of pairs of parts.

        :param pairs: (k,) numbers of pairs.
        """
        modules, joints = self._robot.module_names, self._robot.topology.joint_names
        points = [f'module {name}' for name in modules] + [f'joint {name}' for name in joints]
        segments = self.part_names()
        return [f'{points[self._first[i]]} and {segments[self._second[i]]}' for i in pairs]

    def part_names(self) -> list[str]:
        """Return the (3m,) names of the parts: members, modules, rods."""
        return [
            *(f'member {name}' for name in self._robot.member_names),
            *(f'module {name}' for name in self._robot.module_names),
            *(f'rod {name}' for name in self._robot.module_names),
        ]

    def distances(self, config: Configuration, pairs: Indices | slice = slice(None)) -> Array:
        """
        Return the distances between the surfaces of pairs [m].

        :param config: where the robot is.
        :param pairs: (k,) numbers of pairs; all when left out.
        """
        return self._nearest(config, pairs)[0] - self._reach[pairs]

    def gradients(self, config: Configuration, pairs: Indices) -> Array:
        """
        Return how the distances of some pairs change as nodes move.

        :param config: where the robot is.
        :param pairs: (k,) numbers of pairs.
        :return: (k, 2n) rows on the node velocities (x0, y0, x1, y1, ...) [-].
        """
        _, normals, shares = self._nearest(config, pairs)
        rows = self.part_rows(config, self._second[pairs], shares, normals)
        _add(rows, self._point[:, pairs], normals)
        return rows.view(np.float64)

    def body_distances(
        self, config: Configuration, body: ConvexObject, parts: Indices | slice = slice(None)
    ) -> tuple[Array, Array, Array]:
        """
        Return the distances between an object and parts of the robot, and how they change.

        :param config: where the robot is.
        :param body: the object in its place.
        :param parts: (k,) numbers of parts: members, modules, rods, m of each; all when left out.
        :return: (k,) distances [m], negative by how deep straight parts cut into the object;
            (k, 2n) rows on the node velocities [-], and (k, 3) rows on the twist of the object
            vx, vy [-], omega [m], robot frame.
        """
        starts, ends = self.part_ends(config, parts)
        found = segment_gaps(body, starts, ends)
        rows = self.part_rows(config, parts, found.shares, -found.normals)
        # To the segment: the surface is along the normal from there and turns with the same speed.
        arms = starts + found.shares * (ends - starts) - body.center
        turning = (found.normals.conj() * 1j * arms).real
        twist_rows = -np.column_stack([as_xy(found.normals), turning])
        return found.gaps - self.part_radii[parts], rows.view(np.float64), twist_rows

    def _nearest(
        self, config: Configuration, pairs: Indices | slice
    ) -> tuple[Array, Points, Array]:
        starts, ends = self.part_ends(config, self._second[pairs])
        return nearest_on_segment(_middles(config.points, self._point[:, pairs]), starts, ends)

    def part_ends(
        self, config: Configuration, parts: Indices | slice = slice(None)
    ) -> tuple[Points, Points]:
        """
        Return where the segments of parts begin and end, (k,) each [m].

        :param config: where the robot is.
        :param parts: numbers of parts; all when left out.
        """
        start, end = (
            _middles(config.points, nodes[:, parts]) for nodes in (self._start, self._end)
        )
        return start, end

    def part_rows(
        self, config: Configuration, parts: Indices | slice, shares: Array, normals: Points
    ) -> Points:
        """
        Return what moving parts is worth to their distances from points that stand still.

        :param config: where the robot is.
        :param parts: (k,) numbers of parts, or all.
        :param shares: (k,) of their segments, where these are nearest.
        :param normals: (k,) unit vectors from there to the points.
        :return: (k, n) rows on the node velocities, x + iy [-].
        """
        rows = np.zeros((len(shares), len(config.points)), dtype=np.complex128)
        _add(rows, self._start[:, parts], -(1.0 - shares) * normals)
        _add(rows, self._end[:, parts], -shares * normals)
        return rows


def _measured(robot: Mechanism) -> Array:
    """Return which points (modules, joints) are measured from which segments, (m + j, 3m)."""
    topology = robot.topology
    m = topology.n_modules
    joint = np.concatenate([topology.joint, np.arange(len(topology.joint_names))])
    point, member = np.arange(len(joint))[:, None], np.arange(m)
    own, ahead = topology.joint, topology.joint[topology.following]
    # A member is fixed to the modules and the joints at its ends; other tubes are measured there.
    of_members = np.where(
        point < m,
        (member != point) & (topology.following != point),
        (joint[:, None] != own) & (joint[:, None] != ahead),
    )
    of_modules = (point < m) & (point < member)
    of_rods = joint[:, None] != own
    return np.hstack([of_members, of_modules, of_rods])


@functools.lru_cache(maxsize=16)
def collision_model(robot: Mechanism) -> CollisionModel:
    """
    Return the parts of a robot that must not meet; made once for each robot.

    :param robot: the robot.
    """
    return CollisionModel(robot)
