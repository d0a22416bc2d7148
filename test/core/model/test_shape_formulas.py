# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Discs, ellipses and rounded polygons against formulas of handbooks, and their ranges."""

from isotruss_ros.core import ConvexObject, Polygon
from isotruss_ros.core.errors import GraspError
import numpy as np
import pytest

#: The bounds that messages have, [m].
MIN_DIAMETER, MAX_SIZE, MAX_DISTANCE = 1e-9, 10.0, 1e12


def test_the_middle_of_an_object_is_its_centroid_in_its_pose():
    triangle = Polygon([(0.0, 0.0), (0.3, 0.0), (0.0, 0.6)])
    body = ConvexObject(triangle, (1.0, 2.0, 0.5 * np.pi))
    assert body.middle == pytest.approx(1.0 + 2.0j + 1j * (0.1 + 0.2j))


def test_the_ends_of_an_arc_whose_center_is_outside_are_within_reach():
    """Nearly all of two sides of a triangle is an arc around a point below the third one."""
    height = 0.5 * np.sqrt(3.0)
    radius = 0.99 * np.tan(np.pi / 6.0)
    triangle = Polygon([(-0.5, 0.0), (0.5, 0.0), (0.0, height)], (0.0, 0.0, radius))
    assert triangle.arc_centers[2].imag < -0.2
    assert triangle.reach == pytest.approx(0.5)


@pytest.mark.parametrize(
    ('center', 'size', 'words'),
    [
        ((0.0, 0.0), 0.0, 'must be from'),
        ((0.0, 0.0), 0.99 * MIN_DIAMETER, 'must be from'),
        ((0.0, 0.0), 1.01 * MAX_SIZE, 'must be from'),
        ((1.01 * MAX_DISTANCE, 0.0), 0.1, 'must be within'),
        ((0.0, 0.0, 0.0), 0.1, "the object's centre"),
        ((0.0, 0.0), np.inf, "the object's diameter .* must be a finite number"),
        ((0.0, 0.0), 10**400, "the object's diameter .* must be a finite number"),
    ],
)
def test_values_out_of_range_are_refused(center, size, words):
    with pytest.raises(GraspError, match=words):
        ConvexObject.disc(center, size)
