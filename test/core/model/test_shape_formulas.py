# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Discs, ellipses and rounded polygons against formulas of handbooks, and their ranges."""

from isotruss_ros.core import ConvexObject, Disc, Ellipse, Polygon
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


def test_outlines_have_the_ends_of_arcs_and_points_no_farther_apart_than_asked_for():
    square = Polygon([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)], (0.0, 0.1, 0.0, 0.4))
    spacing = 0.03
    z = square.outline(spacing)
    ends = [0.0, 0.9, 1.0 + 0.1j, 1.0 + 1.0j, 0.4 + 1.0j, 0.6j]
    at = [int(np.abs(z - end).argmin()) for end in ends]
    assert z[at] == pytest.approx(ends, abs=1e-12)
    # As many points along each arc as its length needs, no more, and a corner once.
    counts = [int(np.ceil(0.5 * np.pi * radius / spacing)) for radius in (0.1, 0.4)]
    assert np.diff([*at, len(z)]).tolist() == [1, counts[0], 1, 1, counts[1], 1]
    smaller = z[np.arange(at[1], at[2] + 1)]
    assert np.abs(np.diff(smaller)).max() <= spacing
    for shape in (Disc(1.0), Ellipse((0.5, 0.4))):
        # Of an ellipse these are points of the circle around it, moved toward its long axis.
        z = shape.outline(spacing)
        assert len(z) == int(np.ceil(np.pi / spacing))
        assert len(shape.outline(10.0)) >= 8


def test_tiny_polygons_far_away_are_taken_and_run_counter_clockwise():
    """Down to the smallest sides and area that there may be."""
    least = 1.5e-9
    assert Polygon([(0.0, 0.0), (least, 0.0), (0.0, least)]).corners[1] == least
    rng = np.random.default_rng(3)
    for _ in range(10):
        x, y = 9.9 * rng.uniform(-1.0, 1.0, 2)
        vertices = [(x, y), (x + 1e-6, y), (x, y + 1e-6)]
        for given in (vertices, vertices[::-1]):
            assert Polygon(given).turns.sum() == pytest.approx(2.0 * np.pi)


@pytest.mark.parametrize(
    ('center', 'size', 'words'),
    [
        ((0.0, 0.0), 0.0, 'must be positive'),
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
