# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Convex cross-sections of objects, given by their support functions.

The support function h(n) is the distance of the tangent with the outward normal n from the origin.
The signed distance of a point x, outside or inside, is the maximum of x . n - h(n) over all
normals n. The maximising n is the outward normal at the surface point nearest to x. Points and
normals are complex numbers x + iy in the object's frame.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
import math
from typing import ClassVar, NamedTuple

from isotruss_ros.core.model.pose import check_range, MAX_SIZE, MIN_DIAMETER
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.numerics.tolerances import (
    COINCIDENCE,
    MAX_NEWTON_ITERATIONS,
    NEGLIGIBLE_SHARE,
)
import numpy as np

#: Indentation that is assumed for an object that does not indent a tube yet, in tube radii [-].
PLANNED_DEPTH = 0.02
#: Number of normals from which the search for the nearest surface point starts, about [-].
NORMAL_SAMPLES = 64


class SurfacePoints(NamedTuple):
    """Points x - gap * normal of a surface that are nearest to given points x."""

    gaps: Array  #: (c,) distances of the points from the surface, negative inside [m]
    #: (c,) unit vectors x + iy, the outward normals at the nearest points; at a sharp corner, any
    #: vector in its normal cone
    normals: Points


class Face(NamedTuple):
    """Straight face of a shape, described from the corner at one of its two ends."""

    step: int  #: 1 for the face after this corner, counter-clockwise; -1 for the face before it
    corner: int  #: index of the corner at the other end of the face
    normal: complex  #: outward unit normal, x + iy
    length: float  #: length between the corners, or between the centres of their arcs [m]


class PatchEnd(NamedTuple):
    """One end of the contact patch between a shape and a tube."""

    corner: int  #: index of the corner, see `Shape.corner_at`
    #: point of the corner's arc, which is extended beyond its ends, with the normal toward the
    #: tube, x + iy in the object's frame [m]
    point: complex
    height: float  #: coordinate of the surface along this normal [m]
    along: float  #: distance from the deepest corner along the faces, counter-clockwise [m]


class Shape(ABC):
    """
    Convex cross-section in the frame of the object.

    User-defined shapes derive from this class. Its methods that are not abstract are valid for
    smooth shapes; shapes with faces or corners override them.
    """

    #: Whether the shape is invariant under rotation about the origin.
    is_round: ClassVar[bool] = False

    @property
    @abstractmethod
    def perimeter(self) -> float:
        """Return the length of the outline [m], which is 2 pi times the mean support function."""

    @property
    @abstractmethod
    def centroid(self) -> complex:
        """Return the centroid of the area, x + iy [m]."""

    @property
    @abstractmethod
    def gyration(self) -> float:
        """Return the radius of gyration of the area about its centroid [m]."""

    @property
    @abstractmethod
    def reach(self) -> float:
        """Return the largest distance of the surface from the origin [m]."""

    def support(self, normals: Points) -> Array:
        """
        Return the support function h(n) for given normals, (c,) [m].

        :param normals: (c,) outward unit normals of the tangents, x + iy.
        """
        return (self.support_points(normals) * normals.conj()).real

    def support_points(self, normals: Points) -> Points:
        """
        Return the points (c,) where tangents with given normals touch the surface, x + iy [m].

        On a tangent along a face, the point is one end of the face.

        :param normals: (c,) outward unit normals of the tangents, x + iy.
        """
        return self.surface_at(np.zeros(len(normals), dtype=np.intp), normals)[0]

    def corner_at(self, normal: complex) -> int:
        """
        Return the index of the corner that is farthest along a normal; 0 for a smooth shape.

        :param normal: outward unit normal, x + iy.
        """
        return 0

    def point_at(self, corner: int, normal: complex) -> complex:
        """
        Return the point of a corner's arc with a given normal, x + iy [m].

        :param corner: index of the corner in contact, see `corner_at`.
        :param normal: outward unit normal of the tangent, x + iy.
        """
        return complex(self.surface_at(np.array([corner]), np.array([normal]))[0][0])

    def faces_at(self, corner: int) -> tuple[Face, ...]:
        """
        Return the faces before and after a corner; none for a smooth shape.

        :param corner: index of the corner, see `corner_at`.
        """
        return ()

    def contact_patch(
        self, normal: complex, tube_radius: float, skin: float = math.inf
    ) -> list[PatchEnd]:
        """
        Return the two ends of the contact patch with a tube, or one end for a point contact.

        The ends are in counter-clockwise order. A face is in contact at both ends if both of its
        corners penetrate the straight tube. A face shorter than the tube radius counts as one
        contact. All parts of this package find contacts by this method.

        :param normal: unit vector toward the straight tube, x + iy.
        :param tube_radius: radius of the tube [m].
        :param skin: position of the straight tube's skin along the normal, from the origin [m];
            infinite if the tube is not indented yet.
        """
        # Corners that penetrate the skin, or that would at the planned depth.
        corner = self.corner_at(normal)
        point = self.point_at(corner, normal)
        deepest = PatchEnd(corner, point, (point * normal.conjugate()).real, 0.0)
        depth = max(deepest.height - skin, PLANNED_DEPTH * tube_radius)
        ends = self._ends_above(deepest.height - depth, deepest, normal, tube_radius)
        if len(ends) == 1:
            return ends
        # Of ends with equal heights, the main end is the one nearest to the middle of the object.
        main_height = max(end.height for end in ends) - NEGLIGIBLE_SHARE * depth
        main = min(
            (end for end in ends if end.height >= main_height),
            key=lambda end: abs(((end.point - self.centroid) * normal.conjugate()).imag),
        )
        # The other end is the deepest one at a distance of a tube radius or more.
        others = [end for end in ends if abs(end.along - main.along) >= tube_radius]
        patch = [main, max(others, key=lambda end: end.height)] if others else [main]
        return sorted(patch, key=lambda end: end.along)

    def _ends_above(
        self, height: float, deepest: PatchEnd, normal: complex, tube_radius: float
    ) -> list[PatchEnd]:
        """Return the corners above a height that may be ends of a patch, the deepest first."""
        # They are reached from the deepest corner over short faces, and at most one long face on
        # each side. Those behind a long face are last, because the first of equal ends is chosen.
        behind_short_faces = [deepest]
        behind_long_faces: list[PatchEnd] = []
        for side in range(len(self.faces_at(deepest.corner))):  # before, and after the corner
            corner, along, is_short = deepest.corner, 0.0, True
            while is_short:
                face = self.faces_at(corner)[side]
                corner, along = face.corner, along + face.step * face.length
                is_short = face.length < tube_radius
                face_end = (self.point_at(corner, face.normal) * normal.conjugate()).real
                # A face is in contact at its ends only; a curve of short faces has no ends.
                is_curve = is_short and abs(along) >= tube_radius
                if face_end < height or corner == deepest.corner or is_curve:
                    break
                ends = behind_short_faces if is_short else behind_long_faces
                ends.append(PatchEnd(corner, self.point_at(corner, normal), face_end, along))
        return behind_short_faces + behind_long_faces

    @abstractmethod
    def surface_at(self, corners: Indices, normals: Points) -> tuple[Points, Array]:
        """
        Return points (k,) of the surface with given normals [m], and their radii of curvature [m].

        :param corners: (k,) index of the corner on whose arc each point is; arcs are extended
            beyond their ends.
        :param normals: (k,) outward unit normals, x + iy.
        """

    @abstractmethod
    def unroll(self, angles: Array, corners: Indices) -> Array:
        """
        Return arc lengths (k,) from a fixed surface point to points with given normals [m].

        A shape that rolls on a line touches the line at the point whose normal is perpendicular to
        it, so the difference of two arc lengths is the rolled distance. A full rotation adds the
        perimeter. All points of a face have the same normal, so the arc length jumps at the angle
        of this normal.

        :param angles: (k,) angles of the outward normals, not wrapped to one turn [rad].
        :param corners: (k,) indices of the corners in contact, see `corner_at`.
        """

    @cached_property
    def _sampled_tangents(self) -> tuple[Array, Array, Array]:
        """
        Return angles (k + 2,) of normals around the surface [rad], the first and last ones twice.

        Also return cosines and sines (2, k) of the angles, and the support (k,) there [m].
        """
        samples = self.outline(self.perimeter / NORMAL_SAMPLES)
        chords = np.roll(samples, -1) - np.roll(samples, 1)
        angles = np.unwrap(np.angle(-1j * chords))
        padded = np.concatenate([angles[-1:] - 2.0 * np.pi, angles, angles[:1] + 2.0 * np.pi])
        axes = np.array([np.cos(angles), np.sin(angles)])
        return padded, axes, self.support(np.exp(1j * angles))

    def nearest(self, points: Points) -> SurfacePoints:
        """
        Return the points of the surface nearest to given points.

        :param points: (c,) points x + iy, outside or inside [m].
        """
        # The tangent at the nearest point has the largest signed distance of all tangents. Axes of
        # the search among sampled tangents: point, sample.
        padded, (cosines, sines), support = self._sampled_tangents
        x, y = points.real[:, None], points.imag[:, None]
        best = (x * cosines + y * sines - support).argmax(axis=1)
        # The angle of its normal is between the samples before and after the best sample.
        low, angles, high = padded[best], padded[best + 1], padded[best + 2]
        # Maximisation by Newton's method, or by bisection where a step leaves the bounds.
        corners = np.zeros(len(points), dtype=np.intp)
        for _ in range(MAX_NEWTON_ITERATIONS):
            normals = np.exp(1j * angles)
            feet, radii = self.surface_at(corners, normals)
            # The distance from the tangent, and as imaginary part its derivative by the angle.
            distances = (points - feet) * normals.conj()
            gaps, slopes = distances.real, distances.imag
            is_before = slopes > 0.0
            low, high = np.where(is_before, angles, low), np.where(is_before, high, angles)
            newton = angles + slopes / np.maximum(gaps + radii, COINCIDENCE)
            is_bounded = (newton >= low) & (newton <= high)
            previous, angles = angles, np.where(is_bounded, newton, 0.5 * (low + high))
            if np.abs(angles - previous).max(initial=0.0) <= COINCIDENCE:
                break
        return SurfacePoints(gaps, normals)

    def smoothed(self, length: float) -> Shape:
        """
        Return the smooth shape that this shape approximates, or this shape if there is none.

        A polygon with many corners may approximate a smooth curve through these corners.

        :param length: only faces shorter than this are regarded as chords of a smooth curve [m].
        """
        return self

    @abstractmethod
    def outline(self, spacing: float) -> Points:
        """
        Return points (k,) along the surface, counter-clockwise, without repeating the first [m].

        :param spacing: largest distance of successive points where the surface is curved [m].
        """


@dataclass(frozen=True)
class Disc(Shape):
    """
    Circle around the origin of the object's frame.

    :ivar diameter: diameter d [m].
    :raises GraspError: the diameter is not a positive number within range.
    """

    diameter: float
    is_round: ClassVar[bool] = True
    centroid: ClassVar[complex] = 0j

    def __post_init__(self) -> None:
        """Check the diameter."""
        size = check_range(self.diameter, "the object's diameter", 'm', MIN_DIAMETER, MAX_SIZE)
        object.__setattr__(self, 'diameter', size)

    @cached_property
    def perimeter(self) -> float:
        """Return the circumference of the disc [m]."""
        return np.pi * self.diameter

    @property
    def gyration(self) -> float:
        """Return the radius of gyration of the disc about its centre [m]."""
        return self.diameter / np.sqrt(8.0)

    @cached_property
    def reach(self) -> float:
        """Return the largest distance of the surface from the origin [m]."""
        return 0.5 * self.diameter

    def point_at(self, corner: int, normal: complex) -> complex:
        """Return the point of the surface with a given normal; see `Shape.point_at`."""
        return 0.5 * self.diameter * normal

    def surface_at(self, corners: Indices, normals: Points) -> tuple[Points, Array]:
        """Return points and radii of curvature at given normals; see `Shape.surface_at`."""
        radius = 0.5 * self.diameter
        return radius * normals, np.full(len(normals), radius)

    def nearest(self, points: Points) -> SurfacePoints:
        """Return the nearest points of the surface; see `Shape.nearest`."""
        normals = np.exp(1j * np.angle(points))
        return SurfacePoints(np.abs(points) - 0.5 * self.diameter, normals)

    def unroll(self, angles: Array, corners: Indices) -> Array:
        """Return the arc lengths to points with given normals; see `Shape.unroll`."""
        return 0.5 * self.diameter * angles

    def outline(self, spacing: float) -> Points:
        """Return points along the surface; see `Shape.outline`."""
        count = max(8, int(np.ceil(self.perimeter / spacing)))
        return 0.5 * self.diameter * np.exp(2j * np.pi * np.arange(count) / count)
