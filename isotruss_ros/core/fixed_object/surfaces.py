# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Contact surfaces: the surface of an object, or this surface offset by the tube radius.

The contact problem needs two functions of a convex object: the distance h(n) between the centre
and the tangent with the normal n, and the normal at the surface point nearest to a point. A point
beyond any tangent is outside of the object, so (5) with fixed normals, x . n - h(n) >= 0, excludes
penetration.
"""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core.model.convex_object import ConvexObject, facing_normals
from isotruss_ros.core.model.shapes import Shape, SurfacePoints
from isotruss_ros.core.numerics.arrays import Array, Points
import numpy as np

#: Distance from the object at which initial normals are taken, relative to its size [-].
INITIAL_DISTANCE = 0.3


@dataclass(frozen=True)
class Surface:
    """Surface of a convex object, possibly offset. Points are relative to the object's centre."""

    body: ConvexObject  #: the object at its pose
    margin: float  #: offset of the surface [m]
    shape: Shape  #: shape of the object
    center: complex  #: the centroid of the object's area, x + iy [m]
    reach: float  #: upper bound of the distance of surface points from the centre [m]

    def support(self, normals: Points) -> Array:
        """Return the distances (c,) between the centre and tangents with given normals [m]."""
        if self.shape.is_round:
            return np.full(len(normals), self.reach)
        local = normals * self.body.turn.conjugate()
        inside = (self.shape.centroid * local.conj()).real
        return self.shape.support(local) - inside + self.margin

    def open_gaps(self, away: Points, normals: Points) -> Array:
        """Return the distances (c,) from tangents of points relative to the centre [m]."""
        return (away * normals.conj()).real - self.support(normals)

    def nearest(self, away: Points) -> SurfacePoints:
        """Return the surface points nearest to points relative to the centre (5)."""
        if self.shape.is_round:
            sizes = np.abs(away)
            # The normal nearest to the centre is arbitrary; upward is used.
            upward = np.full(len(away), 1j)
            normals = np.divide(away, sizes, out=upward, where=sizes > 0.0)
            return SurfacePoints(sizes - self.reach, normals)
        local = away * self.body.turn.conjugate() + self.shape.centroid
        gaps, normals = self.shape.nearest(local)
        return SurfacePoints(gaps - self.margin, normals * self.body.turn)

    def facing(self, away: Points, axis: Points) -> Points:
        """Return the outward normals (c,) toward points `away` (c,) of straight tubes."""
        if self.shape.is_round:
            return self.nearest(away).normals
        # The points are shifted outward until they are outside of the object.
        outward = facing_normals(0.0, away, axis)
        short = -self.open_gaps(away, outward)
        back = np.maximum(short + INITIAL_DISTANCE * self.body.arm, 0.0)
        return self.nearest(away + back * outward).normals


def surface_of(body: ConvexObject, margin: float = 0.0) -> Surface:
    """Return an object's surface, moved outward by a margin: 0, or the tube radius [m]."""
    reach = body.shape.reach + abs(body.shape.centroid) + margin
    return Surface(body, margin, body.shape, body.middle, reach)
