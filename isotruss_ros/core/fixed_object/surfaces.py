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

from typing import NamedTuple

from isotruss_ros.core.model.convex_object import ConvexObject, facing_normals
from isotruss_ros.core.model.shapes import SurfacePoints
from isotruss_ros.core.numerics.arrays import Array, Points
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
