# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Surfaces that tubes meet: the object's own, or one as far out as the tube's centre line.

Of a convex object the contact problem needs little: how far the tangent with a normal n is, and
the normal at the foot of a point. A point beyond any one tangent is outside of the object, so that
(5) with fixed normals, x . n - h(n) >= 0, never admits what the object forbids.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Protocol

from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.shapes import Shape, SurfacePoints
from isotruss_ros.core.numerics.arrays import Array, Points
import numpy as np

#: Tubes seen from this far off the object, as a share of its size, have the normals to begin with.
CLEARANCE = 0.3


class Surface(Protocol):
    """
    What points of the tubes meet.

    :ivar center: a point inside, x + iy; all else is relative to it [m].
    :ivar reach: the largest distance of the surface from there [m].
    :ivar tangents: normals (k,) and distances (k,) [m] of tangents that bound it besides.
    """

    center: complex
    reach: float
    tangents: tuple[Points, Array]

    def support(self, normals: Points) -> Array | float:
        """
        Return how far tangents are from the centre, (c,) or one for all [m].

        :param normals: (c,) outward unit normals, x + iy.
        """

    def nearest(self, away: Points) -> SurfacePoints:
        """
        Return what is nearest on the surface, (5).

        :param away: (c,) x + iy, from the centre [m].
        """

    def facing(self, away: Points, axis: Points) -> Points:
        """
        Return the normals (c,) with which tubes meet the object that do not bend yet.

        :param away: (c,) points of the centre lines, from the centre; they may be inside [m].
        :param axis: (c,) directions of the tubes.
        """

    def resolved(self, spacing: float) -> Surface:
        """
        Return the surface as points of a spacing can tell it.

        :param spacing: of the points along a tube [m].
        """


@dataclass(frozen=True)
class RoundSurface:
    """
    A circle.

    :ivar center: of the circle, x + iy [m].
    :ivar reach: its radius [m].
    """

    center: complex
    reach: float
    tangents: ClassVar = np.zeros(0, dtype=np.complex128), np.zeros(0)

    def support(self, normals: Points) -> float:
        """Return how far tangents are from the centre [m]; see `Surface.support`."""
        return self.reach

    def nearest(self, away: Points) -> SurfacePoints:
        """Return what is nearest on the surface, (5); see `Surface.nearest`."""
        sizes = np.abs(away)
        # That of a point at the very centre is any, say upward.
        upward = np.full(len(away), 1j)
        normals = np.divide(away, sizes, out=upward, where=sizes > 0.0)
        return SurfacePoints(sizes - self.reach, normals, np.full(len(away), self.reach))

    def facing(self, away: Points, axis: Points) -> Points:
        """Return the normals (c,) at points of the centre lines; see `Surface.facing`."""
        return self.nearest(away).normals

    def resolved(self, spacing: float) -> RoundSurface:
        """Return the circle itself; see `Surface.resolved`."""
        return self


@dataclass(frozen=True)
class ConvexSurface:
    """
    The surface of a convex object, or a parallel one.

    :ivar body: the object in its place.
    :ivar margin: how far out the surface is [m].
    :ivar shape: of the object, its corners rounded off as points can tell them.
    """

    body: ConvexObject
    margin: float
    shape: Shape

    @cached_property
    def center(self) -> complex:
        """Return the centroid of the object's area, x + iy [m]."""
        return self.body.middle

    @cached_property
    def reach(self) -> float:
        """Return a distance from the centre beyond which there is no surface [m]."""
        return self.body.shape.reach + abs(self._inside) + self.margin

    @cached_property
    def _inside(self) -> complex:
        return self.body.shape.centroid

    def support(self, normals: Points) -> Array:
        """Return how far tangents are from the centre, (c,) [m]; see `Surface.support`."""
        own = normals * self.body.turn.conjugate()
        return self.shape.support(own) - (self._inside * own.conj()).real + self.margin

    def nearest(self, away: Points) -> SurfacePoints:
        """Return what is nearest on the surface, (5); see `Surface.nearest`."""
        turn = self.body.turn
        gaps, normals, radii = self.shape.nearest(away * turn.conjugate() + self._inside)
        return SurfacePoints(gaps - self.margin, normals * turn, radii + self.margin)

    def facing(self, away: Points, axis: Points) -> Points:
        """Return the normals (c,) at points of the centre lines; see `Surface.facing`."""
        # These are pulled back until they are outside.
        aside = (away * axis.conj()).imag
        outward = 1j * np.where(aside < 0.0, -axis, axis)
        short = self.support(outward) - np.abs(aside)
        back = np.maximum(short + CLEARANCE * self.body.arm, 0.0)
        return self.nearest(away + back * outward).normals

    @cached_property
    def tangents(self) -> tuple[Points, Array]:
        """Return normals (k,) and distances (k,) [m] of tangents that bound it besides `reach`."""
        normals = self.body.shape.bounding_normals * self.body.turn
        return normals, self.support(normals)

    def resolved(self, spacing: float) -> ConvexSurface:
        """Return the surface with its corners rounded off; see `Surface.resolved`."""
        return ConvexSurface(self.body, self.margin, self.body.shape.rounded(spacing))


def surface_of(body: ConvexObject, margin: float = 0.0) -> Surface:
    """
    Return the surface of an object, or one that is farther out.

    :param body: the object in its place.
    :param margin: how far out the surface is: 0 for its own, the radius of the tube for what
        centre lines meet where tubes stay round [m].
    """
    if body.shape.is_round:
        return RoundSurface(body.middle, body.shape.reach + margin)
    return ConvexSurface(body, margin, body.shape)
