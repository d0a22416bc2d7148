# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Contact surfaces: the object's own, or its offset to the tube's centre line.

The contact problem needs two functions of a convex object: the distance h(n) of the tangent with a
normal n, and the normal at the foot of a point. A point beyond any tangent is outside of the
object, so (5) with fixed normals, x . n - h(n) >= 0, admits no penetration.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.shapes import Shape, SurfacePoints
from isotruss_ros.core.numerics.arrays import Array, Points
import numpy as np

#: Distance of the points for initial normals, relative to the object's size [-].
INITIAL_DISTANCE = 0.3


@dataclass(frozen=True)
class Surface:
    """
    The surface of a convex object, or a parallel one; points are relative to its centre.

    :ivar body: the object at its pose.
    :ivar margin: offset of the surface [m].
    :ivar shape: shape of the object, corners rounded to the resolution of the points.
    :ivar center: the centroid of the object's area, x + iy [m].
    :ivar reach: upper bound of the distance of the surface from the centre [m].
    """

    body: ConvexObject
    margin: float
    shape: Shape
    center: complex
    reach: float

    @cached_property
    def _inside(self) -> complex:
        return self.body.shape.centroid

    @cached_property
    def _back(self) -> complex:
        return self.body.turn.conjugate()

    def support(self, normals: Points) -> Array:
        """
        Return the support function about the centre, (c,) [m].

        :param normals: (c,) outward unit normals, x + iy.
        """
        if self.shape.is_round:
            return np.full(len(normals), self.reach)
        own = normals * self._back
        return self.shape.support(own) - (self._inside * own.conj()).real + self.margin

    def nearest(self, away: Points) -> SurfacePoints:
        """
        Return the nearest points of the surface, (5).

        :param away: (c,) points relative to the centre, x + iy [m].
        """
        if self.shape.is_round:
            sizes = np.abs(away)
            # That of a point at the very centre is any, say upward.
            upward = np.full(len(away), 1j)
            normals = np.divide(away, sizes, out=upward, where=sizes > 0.0)
            return SurfacePoints(sizes - self.reach, normals, np.full(len(away), self.reach))
        gaps, normals, radii = self.shape.nearest(away * self._back + self._inside)
        return SurfacePoints(gaps - self.margin, normals * self.body.turn, radii + self.margin)

    def facing(self, away: Points, axis: Points) -> Points:
        """
        Return the normals (c,) of unbent tubes on the object.

        :param away: (c,) points of the centre lines relative to the centre, possibly inside [m].
        :param axis: (c,) directions of the tubes.
        """
        if self.shape.is_round:
            return self.nearest(away).normals
        # These are pulled back until they are outside.
        aside = (away * axis.conj()).imag
        outward = 1j * np.where(aside < 0.0, -axis, axis)
        short = self.support(outward) - np.abs(aside)
        back = np.maximum(short + INITIAL_DISTANCE * self.body.arm, 0.0)
        return self.nearest(away + back * outward).normals

    @cached_property
    def tangents(self) -> tuple[Points, Array]:
        """Return normals (k,) and distances (k,) [m] of bounding tangents, besides `reach`."""
        normals = self.body.shape.bounding_normals * self.body.turn
        return normals, self.support(normals)

    def resolved(self, spacing: float) -> Surface:
        """
        Return the surface with corners rounded to the resolution of a spacing.

        :param spacing: spacing of the points along a tube [m].
        """
        if self.shape.is_round:
            return self
        return replace(self, shape=self.body.shape.rounded(spacing))


def surface_of(body: ConvexObject, margin: float = 0.0) -> Surface:
    """
    Return the surface of an object, or its offset.

    :param body: the object at its pose.
    :param margin: offset of the surface: 0, or the tube radius for centre lines of round tubes
        [m].
    """
    reach = body.shape.reach + abs(body.shape.centroid) + margin
    return Surface(body, margin, body.shape, body.middle, reach)
