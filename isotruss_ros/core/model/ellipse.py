# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ellipses as cross-sections of objects."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.model.pose import check_range, MAX_SIZE, MIN_DIAMETER
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.arrays import Array, finite_array, Indices, Points
import numpy as np
import scipy

#: Largest ratio of the semi-axes [-].
MAX_ASPECT_RATIO = 1e3


@dataclass(frozen=True)
class Ellipse(Shape):
    """
    Ellipse around the origin of the object's frame, with axes along x and y.

    :ivar semi_axes: half of the extent along x and along y [m].
    :raises GraspError: the semi-axes are not two positive numbers within range.
    """

    semi_axes: tuple[float, float]
    centroid: ClassVar[complex] = 0j

    def __post_init__(self) -> None:
        """Check the semi-axes."""
        sizes = finite_array(self.semi_axes, 2, 'semi_axes [m]', GraspError).tolist()
        a, b = (check_range(x, 'semi_axes', 'm', MIN_DIAMETER, MAX_SIZE) for x in sizes)
        if max(a, b) > MAX_ASPECT_RATIO * min(a, b):
            raise GraspError(
                f'semi_axes ({a:g}, {b:g}) m: must differ by at most a factor of '
                f'{MAX_ASPECT_RATIO:g}'
            )
        object.__setattr__(self, 'semi_axes', (a, b))

    @cached_property
    def perimeter(self) -> float:
        """Return the length of the ellipse's outline [m]."""
        long, short = max(self.semi_axes), min(self.semi_axes)
        return float(4.0 * long * scipy.special.ellipe(1.0 - (short / long) ** 2))

    @property
    def gyration(self) -> float:
        """Return the radius of gyration of the ellipse's area about its centroid [m]."""
        return 0.5 * float(np.hypot(*self.semi_axes))

    @property
    def reach(self) -> float:
        """Return the largest distance of the surface from the origin [m]."""
        return max(self.semi_axes)

    def surface_at(self, corners: Indices, normals: Points) -> tuple[Points, Array]:
        """Return points and radii of curvature at given normals; see `Shape.surface_at`."""
        a, b = self.semi_axes
        x, y = a * normals.real, b * normals.imag
        support = np.hypot(x, y)
        return (a * x + 1j * b * y) / support, (a * b) ** 2 / support**3

    def unroll(self, angles: Array, corners: Indices) -> Array:
        """Return the arc lengths from the x axis to surface points; see `Shape.unroll`."""
        a, b = self.semi_axes
        # The parameter of the point: its normal is along (cos t / a, sin t / b).
        parameter = np.angle(a * np.cos(angles) + 1j * b * np.sin(angles))
        parameter += 2.0 * np.pi * np.round((angles - parameter) / (2.0 * np.pi))
        return np.asarray(b * scipy.special.ellipeinc(parameter, 1.0 - (a / b) ** 2))

    def outline(self, spacing: float) -> Points:
        """Return points along the surface; see `Shape.outline`."""
        # As many in each quarter, so that the points are symmetric about both axes.
        count = 4 * max(4, int(np.ceil(0.5 * np.pi * self.reach / spacing)))
        along = 2.0 * np.pi * np.arange(count) / count
        return self.semi_axes[0] * np.cos(along) + 1j * self.semi_axes[1] * np.sin(along)
