# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Surface of an object, and candidate contact points on the centre lines of the tubes near it.

The contact problem needs two functions of a convex object: the distance h(n) between the centre
and the tangent with the normal n, and the normal at the surface point nearest to a point. A point
beyond any tangent is outside of the object, so (5) with fixed normals, x . n - h(n) >= 0, excludes
penetration.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from isotruss_ros.core.fixed_object.straight_compliance import straight_points, StraightPoints
from isotruss_ros.core.model.convex_object import ConvexObject, facing_normals
from isotruss_ros.core.model.shapes import SurfacePoints
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, Points
from isotruss_ros.core.statics.structure import Structure
import numpy as np

#: Distance from the object at which initial normals are taken, relative to its size [-].
INITIAL_DISTANCE = 0.3


class Surface(NamedTuple):
    """Surface of a convex object, possibly offset; points and normals are in the robot frame."""

    body: ConvexObject  #: the object at its pose
    margin: float = 0.0  #: offset of the surface, outward [m]

    def open_gaps(self, points: Points, normals: Points) -> Array:
        """Return the distances (c,) of points from tangents with given normals [m]."""
        away = ((points - self.body.center) * normals.conj()).real
        return away - self.body.support(normals) - self.margin

    def nearest(self, points: Points) -> SurfacePoints:
        """Return the surface points nearest to points (5)."""
        gaps, normals = self.body.nearest(points)
        return SurfacePoints(gaps - self.margin, normals)

    def facing(self, points: Points, axis: Points) -> Points:
        """Return the outward normals (c,) toward points (c,) of straight tubes."""
        # The points are shifted outward until they are outside of the object.
        outward = facing_normals(self.body.middle, points, axis)
        short = INITIAL_DISTANCE * self.body.arm - self.open_gaps(points, outward)
        return self.nearest(points + np.maximum(short, 0.0) * outward).normals


class ContactPoints(NamedTuple):
    """Candidate contact points, ordered by member and by distance from the member's start."""

    points: Points  #: (c,) positions on the undeformed centre lines, x + iy [m]
    normals: Points  #: (c,) outward unit normals of the surface toward the points, x + iy
    member: Indices  #: (c,) index of the member of each point
    compliance: Array  #: (2 c, 2 c) displacements x, then y, of the points per force x, y [m/N]

    def displacements(self, forces: Points) -> Points:
        """Return the motions (c,) of the points by forces (c,), x + iy [m, N]."""
        x, y = (self.compliance @ np.concatenate([forces.real, forces.imag])).reshape(2, -1)
        return x + 1j * y

    def normal_compliance(self, normals: Points) -> Array:
        """Return the compliance (c, c) along unit normals (c,), N^T S^-1 N of (8) [m/N]."""
        count, x, y = len(normals), normals.real, normals.imag
        to_normals = self.compliance[:, :count] * x + self.compliance[:, count:] * y
        return x[:, None] * to_normals[:count] + y[:, None] * to_normals[count:]

    def part(self, chosen: Flags) -> ContactPoints:
        """Return the points that a mask (c,) chooses."""
        both = np.tile(chosen, 2)
        compliance = self.compliance[both][:, both]
        return ContactPoints(
            self.points[chosen], self.normals[chosen], self.member[chosen], compliance
        )


def find_contact_points(
    structure: Structure, surface: Surface, spacing: float
) -> tuple[ContactPoints, Array, StraightPoints]:
    """
    Return contact points, their distances (c,) from the members' starts [m], and their structure.

    Points are placed where a member may touch the surface, offset by the tube radius.
    """
    config, body = structure.config, surface.body
    starts, axes = config.points[config.robot.topology.b], config.member_axes
    lengths = config.member_lengths
    # The margin of two spacings is for a tube that bends and touches beyond the object's chord.
    margin = 2.0 * spacing
    reach = body.shape.reach + abs(body.shape.centroid) + surface.margin + margin
    centroids = (body.middle - starts) * axes.conj()  # along + i across each member
    half_chords = np.sqrt(np.maximum(0.0, reach**2 - centroids.imag**2))
    # Points are counted from the foot of the object's centroid on the tube, where contact begins.
    # So a symmetric grasp has symmetric points.
    feet = centroids.real
    lowest, highest = np.maximum(feet - half_chords, 0.0), np.minimum(feet + half_chords, lengths)
    crossing = np.flatnonzero(highest > lowest)
    numbers = [
        np.arange(math.ceil((low - foot) / spacing), math.floor((high - foot) / spacing) + 1)
        for low, high, foot in np.stack([lowest, highest, feet], axis=1)[crossing].tolist()
    ]
    member = crossing.repeat([len(counted) for counted in numbers])
    along = feet[member] + spacing * np.concatenate([np.zeros(0), *numbers])
    places = np.clip(along, 0.0, lengths[member])
    points = starts[member] + places * axes[member]
    normals = surface.facing(points, axes[member])
    candidates = surface.open_gaps(points, normals) <= margin
    points, normals = points[candidates], normals[candidates]
    member, places = member[candidates], places[candidates]
    tubes = straight_points(structure, member, places)
    return ContactPoints(points, normals, member, tubes.compliance), places, tubes
