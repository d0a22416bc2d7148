# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Smooth convex curves through the corners of polygons that approximate a curved outline.

The tangent at a corner is the tangent of the conic through five corners: this corner and two on
each side. It is exact for circles and ellipses. The distance h of a tangent from the centroid is a
periodic quintic spline of the angle of the tangent's normal n. So the surface point (h + i h') n
and the radius of curvature h + h'' are continuous.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from isotruss_ros.core.model.outline_checks import polygon_moments
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
import numpy as np

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

#: Number of samples of the curve between two corners, for bounds and initial guesses [-].
SAMPLES = 4


@dataclass(frozen=True)
class PolygonalShape(Shape):
    """Shape given by the vertices of a polygon."""

    #: (x, y) of the vertices, counter-clockwise [m]
    vertices: tuple[tuple[float, float], ...]

    @cached_property
    def corners(self) -> Points:
        """Return the polygon's vertices, (k,) counter-clockwise x + iy [m]."""
        return np.array(self.vertices) @ np.array([1.0, 1.0j])

    @cached_property
    def _moments(self) -> tuple[float, complex, float]:
        """Return the integrals of 1, z and |z|^2 over the area, with z = x + iy."""
        return polygon_moments(self.corners)

    @cached_property
    def centroid(self) -> complex:
        """Return the centroid of the area, x + iy [m]."""
        return self._moments[1] / self._moments[0]

    @property
    def gyration(self) -> float:
        """Return the radius of gyration of the area about its centroid [m]."""
        area, _, second = self._moments
        return float(np.sqrt(second / area - abs(self.centroid) ** 2))


@dataclass(frozen=True)
class SmoothOutline(PolygonalShape):
    """
    Smooth curve through 5 or more corners of a convex polygon.

    Centroid and radius of gyration are those of the straight-sided polygon.
    """

    @cached_property
    def perimeter(self) -> float:
        """Return the length of the smooth curve [m]."""
        return float(np.diff(self._integral(self._angles[[0, -1]]))[0])

    @cached_property
    def reach(self) -> float:
        """Return the largest distance of the surface from the origin [m]."""
        return float(np.abs(self.support_points(np.exp(1j * self._divide(SAMPLES)))).max())

    @cached_property
    def _angles(self) -> Array:
        """Return the normals' angles at the n corners, and the first again plus 2 pi, (n + 1,)."""
        tangents = _conic_tangents(self.corners)
        turns = np.angle(np.roll(tangents, -1) / tangents)
        return float(np.angle(-1j * tangents[0])) + np.append(0.0, np.cumsum(turns))

    @cached_property
    def _integral(self) -> PPoly:
        """Return the integral of the support function h over the normal's angle."""
        from scipy import interpolate

        from_centroid = self.corners - self.centroid
        heights = (from_centroid * np.exp(-1j * self._angles[:-1])).real
        spline = interpolate.make_interp_spline(
            self._angles, np.append(heights, heights[0]), k=5, bc_type='periodic'
        )
        return interpolate.PPoly.from_spline(spline.antiderivative())

    def _divide(self, pieces: int) -> Array:
        """Return the normals' angles at the n corners and between them, (pieces n,) [rad]."""
        shares = np.arange(pieces) / pieces
        return (self._angles[:-1, None] + np.diff(self._angles)[:, None] * shares).ravel()

    @cached_property
    def is_convex(self) -> bool:
        """Return whether the curve turns to the left everywhere, by one full turn in total."""
        turns_once = abs(self._angles[-1] - self._angles[0] - 2.0 * np.pi) < 1e-9
        if not turns_once or np.diff(self._angles).min() <= 0.0:
            return False
        _, h, _, second = self._support_derivatives(self._divide(SAMPLES))
        return bool((h + second).min() > 0.0)  # radii of curvature

    def _support_derivatives(self, angles: Array) -> Array:
        """Return (4, k) the integral of the support function h, then h, h' and h'' at angles."""
        within_turn = self._angles[0] + (angles - self._angles[0]) % (2.0 * np.pi)
        return np.array([self._integral(within_turn, order) for order in range(4)])

    def surface_at(self, corners: Indices, normals: Points) -> tuple[Points, Array]:
        """Return points and radii of curvature at given normals; see `Shape.surface_at`."""
        _, h, slope, second = self._support_derivatives(np.angle(normals))
        return self.centroid + (h + 1j * slope) * normals, h + second

    def unroll(self, angles: Array, corners: Indices) -> Array:
        """Return the arc lengths to points with given normals; see `Shape.unroll`."""
        # The integral of the radius of curvature h + h''.
        integral, _, slope, _ = self._support_derivatives(angles)
        full_turns = np.floor((angles - self._angles[0]) / (2.0 * np.pi))
        return np.asarray(integral + slope + self.perimeter * full_turns)

    def outline(self, spacing: float) -> Points:
        """Return points along the surface; see `Shape.outline`."""
        longest = np.abs(np.diff(self.corners, append=self.corners[0])).max()
        return self.support_points(np.exp(1j * self._divide(1 + int(longest / spacing))))


def _conic_tangents(points: Points) -> Points:
    """Return the unit tangents (n,) of conics through each point and two points on each side."""
    size = np.abs(points - points.mean()).max()
    # Pascal's theorem: the pairs of opposite sides of a hexagon on a conic meet in three points of
    # one line. The first two corners coincide at the point, so the first side is the tangent.
    hexagon = []
    for offset in (0, 0, 1, -2, 2, -1):
        corners = (np.roll(points, -offset) - points) / size
        hexagon.append(np.array([corners.real, corners.imag, np.ones(len(corners))]).T)
    # In homogeneous coordinates, the cross product of two points is the line through them, and the
    # cross product of two lines is their intersection.
    sides = [np.cross(hexagon[i], hexagon[(i + 1) % 6]) for i in range(6)]
    pascal_line = np.cross(np.cross(sides[1], sides[4]), np.cross(sides[2], sides[5]))
    tangents = np.cross(hexagon[0], np.cross(sides[3], pascal_line))
    # The line a x + b y + c = 0 has the direction (b, -a); it is chosen counter-clockwise.
    directions = tangents[:, 1] - 1j * tangents[:, 0]
    chords = np.roll(points, -1) - np.roll(points, 1)
    return directions / np.abs(directions) * np.sign((directions * chords.conj()).real)
