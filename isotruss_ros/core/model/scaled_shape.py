# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Cross-sections that are similar to other cross-sections."""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core.model.shapes import Face, PatchEnd, Shape, SurfacePoints
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
import numpy as np


@dataclass(frozen=True)
class ScaledShape(Shape):
    """
    Shape enlarged by a factor about the origin of the object's frame.

    :ivar base: shape of the factor 1.
    :ivar factor: ratio of lengths to those of `base` [-].
    :ivar interpolated: whether depths of dents are interpolated between those of other sizes and
        pressures, see `core.contact.dents`.
    """

    base: Shape
    factor: float
    interpolated: bool = False

    @property
    def is_round(self) -> bool:  # type: ignore[override]
        """Return whether the shape is invariant under rotation about the origin."""
        return self.base.is_round

    @property
    def perimeter(self) -> float:
        """Return the length of the outline [m]."""
        return self.factor * self.base.perimeter

    @property
    def centroid(self) -> complex:
        """Return the centroid of the area, x + iy [m]."""
        return self.factor * self.base.centroid

    @property
    def gyration(self) -> float:
        """Return the radius of gyration of the area about its centroid [m]."""
        return self.factor * self.base.gyration

    @property
    def reach(self) -> float:
        """Return the largest distance of the surface from the origin [m]."""
        return self.factor * self.base.reach

    def support_points(self, normals: Points) -> Points:
        """Return the points where tangents touch the surface; see `Shape.support_points`."""
        return self.factor * self.base.support_points(normals)

    def corner_at(self, normal: complex) -> int:
        """Return the corner that is farthest along a normal; see `Shape.corner_at`."""
        return self.base.corner_at(normal)

    def point_at(self, corner: int, normal: complex) -> complex:
        """Return the point of a corner's arc with a given normal; see `Shape.point_at`."""
        return self.factor * self.base.point_at(corner, normal)

    def faces_at(self, corner: int) -> tuple[Face, ...]:
        """Return the faces before and after a corner; see `Shape.faces_at`."""
        faces = self.base.faces_at(corner)
        return tuple(face._replace(length=self.factor * face.length) for face in faces)

    def contact_patch(
        self, normal: complex, tube_radius: float, skin: float = np.inf
    ) -> list[PatchEnd]:
        """Return the ends of the contact patch with a tube; see `Shape.contact_patch`."""
        k = self.factor
        ends = self.base.contact_patch(normal, tube_radius / k, skin / k)
        return [PatchEnd(e.corner, k * e.point, k * e.height, k * e.along) for e in ends]

    def surface_at(self, corners: Indices, normals: Points) -> tuple[Points, Array]:
        """Return points and radii of curvature at given normals; see `Shape.surface_at`."""
        points, radii = self.base.surface_at(corners, normals)
        return self.factor * points, self.factor * radii

    def unroll(self, angles: Array, corners: Indices) -> Array:
        """Return the arc lengths to points with given normals; see `Shape.unroll`."""
        return self.factor * self.base.unroll(angles, corners)

    def nearest(self, points: Points) -> SurfacePoints:
        """Return the nearest points of the surface; see `Shape.nearest`."""
        nearest = self.base.nearest(points / self.factor)
        return nearest._replace(gaps=self.factor * nearest.gaps)

    def outline(self, spacing: float) -> Points:
        """Return points along the surface; see `Shape.outline`."""
        return self.factor * self.base.outline(spacing / self.factor)
