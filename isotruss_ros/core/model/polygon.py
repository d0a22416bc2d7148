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
        """Return the unit normals in the middles of the arcs, (k,)."""
        middle = self.normals + np.roll(self.normals, 1)
        return middle / np.abs(middle)

    @cached_property
    def _moments(self) -> tuple[float, complex, float]:
        """Return the integrals of 1, z and |z|^2 over the area, with z = x + iy."""
        # The area is that of the polygon through the starts, centres and ends of the arcs...
        centers, radii, half_turns = self.arc_centers, self.radii, 0.5 * self.turns
        starts = centers + radii * np.roll(self.normals, 1)
        ends = centers + radii * self.normals
        polygon = polygon_moments(np.stack([starts, centers, ends], axis=1).ravel())
        # ... and of the circular sectors of the arcs.
        areas = half_turns * radii**2
        centroids = centers + self._outward * radii * 2.0 * np.sin(half_turns) / (3.0 * half_turns)
        # Mean of |z|^2 = |z - c|^2 + 2 Re(z conj(c)) - |c|^2 over a sector with the centre c.
        squares = 0.5 * radii**2 + 2.0 * (centroids * centers.conj()).real - np.abs(centers) ** 2
        return (
            polygon[0] + float(areas.sum()),
            polygon[1] + complex(areas @ centroids),
            polygon[2] + float(areas @ squares),
        )

    @cached_property
    def perimeter(self) -> float:
        """Return the length of the polygon's outline [m]."""
        sides = np.abs(np.roll(self.corners, -1) - self.corners)
        # An arc replaces the two pieces of sides between its ends and the vertex.
        shortened = self.radii * (2.0 * np.tan(0.5 * self.turns) - self.turns)
        return float(sides.sum() - shortened.sum())

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
        """Return the points with given normals; see `Shape.support_points`."""
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
        # Normal and length k are those of the face from corner k to the next corner.
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
        """Return points and radii of corners' arcs at given normals; see `Shape.surface_at`."""
        radii = self.radii[corners]
        return self.arc_centers[corners] + radii * normals, radii

    def unroll(self, angles: Array, corners: Indices) -> Array:
        """Return the arc lengths to points on corners' arcs; see `Shape.unroll`."""
        middle_angles, middle_lengths = self._unrolled_corners
        from_middles = angles - middle_angles[corners]
        full_turns = np.round(from_middles / (2.0 * np.pi))
        arc_angles = from_middles - 2.0 * np.pi * full_turns
        arc_lengths = middle_lengths[corners] + self.radii[corners] * arc_angles
        return arc_lengths + self.perimeter * full_turns

    @cached_property
    def _unrolled_corners(self) -> tuple[Array, Array]:
        """Return the normals' angles (k,) in the middles of arcs, and arc lengths (k,) there."""
        middle_angles = np.angle(self.normals[0]) + self._directions - 0.5 * self.turns
        half_arcs = 0.5 * self.radii * self.turns
        # A face is shorter than the distance of the centres of arcs with different radii.
        between_centers = np.roll(self.arc_centers, -1) - self.arc_centers
        face_lengths = (between_centers * (1j * self.normals).conj()).real
        between_middles = half_arcs[:-1] + face_lengths[:-1] + half_arcs[1:]
        return middle_angles, np.append(0.0, np.cumsum(between_middles))

    def nearest(self, points: Points) -> SurfacePoints:
        """Return the nearest points of the surface; see `Shape.nearest`."""
        # Axes: point, corner. Components of vectors from the centres of the arcs: along the normal
        # of the next side (real) and along the next side (imaginary), and along the previous side.
        rows = np.arange(len(points))
        from_centers = points[:, None] - self.arc_centers
        by_next_side = from_centers * self.normals.conj()
        along_previous_side = (from_centers * np.roll(self.normals, 1).conj()).imag
        # The nearest side has the largest signed distance.
        side_gaps = by_next_side.real - self.radii
        sides = side_gaps.argmax(axis=1)
        gaps, normals = side_gaps[rows, sides], self.normals[sides]
        # An arc is nearest where the vector from its centre is in its normal cone: before the next
        # side, and behind the previous side.
        in_cone = (by_next_side.imag < 0.0) & (along_previous_side > 0.0)
        if not in_cone.any():
            return SurfacePoints(gaps, normals)
        arc_gaps = np.where(in_cone, np.abs(from_centers) - self.radii, -np.inf)
        corners = arc_gaps.argmax(axis=1)
        largest_arc_gaps = arc_gaps[rows, corners]
        at_arc = np.flatnonzero(largest_arc_gaps > gaps)
        radial = from_centers[at_arc, corners[at_arc]]
        gaps[at_arc], normals[at_arc] = largest_arc_gaps[at_arc], radial / np.abs(radial)
        return SurfacePoints(gaps, normals)

    def smoothed(self, length: float) -> Shape:
        """
        Return the smooth curve that the polygon approximates, or the polygon if there is none.

        The polygon approximates a smooth curve if all corners turn by less than `MAX_SAMPLE_TURN`,
        all faces are shorter than `length`, and a convex curve through the corners exists.

        :param length: only faces shorter than this are regarded as chords of a smooth curve [m].
        """
        longest = max(following.length for _, following in self._faces)
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
        arcs = []
        for center, radius, turn, start_normal in zip(
            self.arc_centers, self.radii, self.turns, np.roll(self.normals, 1), strict=True
        ):
            count = 1 + int(np.ceil(radius * turn / spacing))
            normals = start_normal * np.exp(1j * np.linspace(0.0, turn, count))
            arcs.append(center + radius * normals)
        return np.concatenate(arcs)
