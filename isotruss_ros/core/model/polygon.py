# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Convex polygons with sharp or rounded corners."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from isotruss_ros.core.model.outline_checks import check_outline, polygon_moments
from isotruss_ros.core.model.shapes import Face, Shape, SurfacePoints
from isotruss_ros.core.model.smooth_outline import PolygonalShape, SmoothOutline
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.numerics.tolerances import COINCIDENCE
import numpy as np

#: Largest exterior angle of corners that are regarded as samples of a smooth outline [rad]. The
#: exterior angles of regular polygons with 13 or more corners are smaller, and so are those of 24
#: corners on an ellipse with an aspect ratio below 1.9.
MAX_SAMPLE_TURN = 0.5


@dataclass(frozen=True)
class Polygon(PolygonalShape):
    """
    Convex polygon with sharp corners, or with corners rounded by arcs tangent to both sides.

    A polygon with many corners may approximate a smooth outline, see `smoothed`.

    :ivar vertices: (x, y) of three or more vertices in the object's frame [m], clockwise or
        counter-clockwise, without repetition of the first. They are stored counter-clockwise.
    :ivar corner_radius: radius of the arcs [m], given as one number for all corners or as one
        number for each corner; 0 for a sharp corner.
    :raises GraspError: the polygon is not convex, or an arc does not fit; the message names the
        vertex.
    """

    vertices: tuple[tuple[float, float], ...]
    corner_radius: float | tuple[float, ...] = 0.0

    def __post_init__(self) -> None:
        """Check the fields, and orient the vertices counter-clockwise."""
        corners, radii = check_outline(self.vertices, self.corner_radius)
        step = 1 if polygon_moments(corners - corners[0])[0] > 0.0 else -1
        vertices = tuple((float(z.real), float(z.imag)) for z in corners[::step])
        object.__setattr__(self, 'vertices', vertices)
        one_for_each = isinstance(self.corner_radius, Sequence)
        corner_radius = tuple(map(float, radii[::step])) if one_for_each else float(radii[0])
        object.__setattr__(self, 'corner_radius', corner_radius)

    @cached_property
    def normals(self) -> Points:
        """Return the outward unit normals of the sides, each from a vertex to the next, (k,)."""
        sides = np.roll(self.corners, -1) - self.corners
        return -1j * sides / np.abs(sides)

    @cached_property
    def radii(self) -> Array:
        """Return the radii of the arcs at the vertices, (k,) [m]."""
        return np.broadcast_to(np.asarray(self.corner_radius, dtype=float), len(self.vertices))

    @cached_property
    def turns(self) -> Array:
        """Return the exterior angles of the polygon at the vertices, (k,) [rad]."""
        return np.angle(self.normals * np.roll(self.normals, 1).conj())

    @cached_property
    def arc_centers(self) -> Points:
        """Return the centres (k,) of the arcs, x + iy [m]; a sharp corner is its own centre."""
        return self.corners - self.radii * self._outward / np.cos(0.5 * self.turns)

    @cached_property
    def _outward(self) -> Points:
        """Return the normals in the middle of the arcs, (k,)."""
        middle = self.normals + np.roll(self.normals, 1)
        return middle / np.abs(middle)

    @cached_property
    def _moments(self) -> tuple[float, complex, float]:
        """Return the integrals of 1, z and |z|^2 over the area, with z = x + iy."""
        # The polygon through the arcs' ends and centres, and the sectors of the arcs.
        centers, radii, half = self.arc_centers, self.radii, 0.5 * self.turns
        ends = centers + radii * np.array([np.roll(self.normals, 1), self.normals])
        area, first, second = polygon_moments(np.stack([ends[0], centers, ends[1]], 1).ravel())
        sectors = half * radii**2
        means = centers + self._outward * radii * 2.0 * np.sin(half) / (3.0 * half)
        # Parallel-axis theorem, from the arcs' centres to the origin.
        squares = 0.5 * radii**2 + 2.0 * (means * centers.conj()).real - np.abs(centers) ** 2
        return (
            area + float(sectors.sum()),
            first + complex(sectors @ means),
            second + float(sectors @ squares),
        )

    @cached_property
    def perimeter(self) -> float:
        """Return the length of the polygon's outline [m]."""
        saved = self.radii * (2.0 * np.tan(0.5 * self.turns) - self.turns)
        return float(np.abs(np.roll(self.corners, -1) - self.corners).sum() - saved.sum())

    @cached_property
    def reach(self) -> float:
        """Return the largest distance of the surface from the origin [m]."""
        # The normal at the farthest point is along the line from the origin to this point.
        normals = np.exp(1j * np.angle(self.arc_centers))
        return float(np.abs(self.support_points(normals)).max())

    @cached_property
    def _directions(self) -> Array:
        """Return the angles (k,) of the sides' normals relative to the first normal [rad]."""
        return np.append(0.0, np.cumsum(self.turns[1:]))

    def _corner_of(self, normals: Points) -> Indices:
        """
        Return the index (c,) of the vertex whose normal cone contains each direction (c,).

        A direction along the normal of a side, up to rounding, is in the cone before it.
        """
        angles = np.angle(normals * self.normals[0].conj()) - COINCIDENCE
        angles %= 2.0 * np.pi
        return self._directions.searchsorted(angles) % len(self.vertices)

    def support_points(self, normals: Points) -> Points:
        """Return the points where tangents touch the surface; see `Shape.support_points`."""
        return self.surface_at(self._corner_of(normals), normals)[0]

    def corner_at(self, normal: complex) -> int:
        """Return the farthest corner along a normal; see `Shape.corner_at`."""
        return int(self._corner_of(np.array([normal]))[0])

    def faces_at(self, corner: int) -> tuple[Face, ...]:
        """Return the faces at a corner; see `Shape.faces_at`."""
        return self._faces[corner]

    @cached_property
    def _faces(self) -> list[tuple[Face, Face]]:
        """Return the faces before and after each corner."""
        count, centers = len(self.vertices), self.arc_centers
        lengths = np.abs(np.roll(centers, -1) - centers).tolist()
        normals = self.normals.tolist()
        return [
            (
                Face(-1, (k - 1) % count, normals[k - 1], lengths[k - 1]),
                Face(1, (k + 1) % count, normals[k], lengths[k]),
            )
            for k in range(count)
        ]

    def surface_at(self, corners: Indices, normals: Points) -> tuple[Points, Array]:
        """Return points with given normals on corners' arcs; see `Shape.surface_at`."""
        radii = self.radii[corners]
        return self.arc_centers[corners] + radii * normals, radii

    def unroll(self, angles: Array, corners: Indices) -> Array:
        """Return the arc lengths to points on corners' arcs; see `Shape.unroll`."""
        middles, starts = self._unrolled_corners
        from_middles = angles - middles[corners]
        turns = np.round(from_middles / (2.0 * np.pi))
        within = from_middles - 2.0 * np.pi * turns
        return starts[corners] + self.radii[corners] * within + self.perimeter * turns

    @cached_property
    def _unrolled_corners(self) -> tuple[Array, Array]:
        """Return angles (k,) of the corners' middle normals, and arc lengths (k,) there."""
        middles = np.angle(self.normals[0]) + self._directions - 0.5 * self.turns
        between_centers = np.roll(self.arc_centers, -1) - self.arc_centers
        faces = (between_centers * (1j * self.normals).conj()).real
        half_arcs = 0.5 * self.radii * self.turns
        steps = half_arcs[:-1] + faces[:-1] + half_arcs[1:]
        return middles, np.append(0.0, np.cumsum(steps))

    def nearest(self, points: Points) -> SurfacePoints:
        """Return the nearest points of the surface; see `Shape.nearest`."""
        rows = np.arange(len(points))
        from_centers = points[:, None] - self.arc_centers
        # Components across and along the side after a vertex, and along the side before it.
        after = from_centers * self.normals.conj()
        along_before = (from_centers * np.roll(self.normals, 1).conj()).imag
        from_sides = after.real - self.radii
        side = from_sides.argmax(axis=1)
        gaps, normals = from_sides[rows, side], self.normals[side]
        # An arc is nearest where the direction from its centre is in its normal cone.
        in_cone = (after.imag < 0.0) & (along_before > 0.0)
        if not in_cone.any():
            return SurfacePoints(gaps, normals)
        from_arcs = np.where(in_cone, np.abs(from_centers) - self.radii, -np.inf)
        corner = from_arcs.argmax(axis=1)
        arc_gaps = from_arcs[rows, corner]
        at_arc = np.flatnonzero(arc_gaps > gaps)
        from_center = from_centers[at_arc, corner[at_arc]]
        gaps[at_arc], normals[at_arc] = arc_gaps[at_arc], from_center / np.abs(from_center)
        return SurfacePoints(gaps, normals)

    def smoothed(self, length: float) -> Shape:
        """
        Return the smooth curve that the polygon approximates, or the polygon if there is none.

        The polygon approximates a smooth curve if all corners turn by less than `MAX_SAMPLE_TURN`,
        all faces are shorter than `length`, and a convex curve through the corners exists.

        :param length: only faces shorter than this are regarded as chords of a smooth curve [m].
        """
        longest = np.abs(np.roll(self.arc_centers, -1) - self.arc_centers).max()
        return self if self._curve is None or longest >= length else self._curve

    @cached_property
    def _curve(self) -> SmoothOutline | None:
        """Return the smooth convex curve through the corners; None if it does not exist."""
        if self.turns.max() >= MAX_SAMPLE_TURN:
            return None
        tips = self.arc_centers + self.radii * self._outward
        curve = SmoothOutline(tuple(zip(tips.real.tolist(), tips.imag.tolist(), strict=True)))
        return curve if curve.is_convex else None

    def outline(self, spacing: float) -> Points:
        """Return points along the surface; see `Shape.outline`."""
        parts = []
        for center, radius, turn, normal in zip(
            self.arc_centers, self.radii, self.turns, np.roll(self.normals, 1), strict=True
        ):
            count = 1 + int(np.ceil(radius * turn / spacing))
            along = np.linspace(0.0, turn, count)
            parts.append(center + radius * normal * np.exp(1j * along))
        return np.concatenate(parts)
