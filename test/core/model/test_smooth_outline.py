# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Smooth curves through the corners of polygons, against the ellipses on which these are."""

from isotruss_ros.core import Disc, Ellipse, Polygon
from isotruss_ros.core.model.smooth_outline import SmoothOutline
import numpy as np
import pytest
from shapes import regular_polygon, sampled

ANGLES = np.linspace(-7.0, 7.0, 1001)
NORMALS = np.exp(1j * ANGLES)
NONE = np.zeros(len(ANGLES), dtype=np.intp)
ELLIPSES = [Ellipse((0.15, 0.1)), Ellipse((0.09, 0.12))]
#: Shift of the frame [m].
AWAY = 0.2 - 0.1j


def curve_of(ellipse, count, away=0j):
    """Return the curve through corners on an ellipse, written in a frame away from its middle."""
    return sampled(ellipse, count, 0.3, away).smoothed(1.0)


@pytest.mark.parametrize('ellipse', ELLIPSES)
@pytest.mark.parametrize(('count', 'place', 'radius'), [(24, 2e-6, 3e-4), (96, 1e-8, 1e-6)])
def test_points_and_radii_are_those_of_the_ellipse(ellipse, count, place, radius):
    curve = curve_of(ellipse, count, AWAY)
    points, radii = curve.surface_at(NONE, NORMALS)
    wanted, exact = ellipse.surface_at(NONE, NORMALS)
    assert np.abs(points - wanted - AWAY).max() < place
    assert np.abs(radii / exact - 1.0).max() < radius
    assert curve.support_points(NORMALS) == pytest.approx(points, abs=1e-15)
    assert curve.perimeter == pytest.approx(ellipse.perimeter, rel=1e-6)


@pytest.mark.parametrize('ellipse', ELLIPSES)
def test_nearest_point_is_at_the_largest_distance_from_a_tangent(ellipse):
    random = np.random.default_rng(1)
    points = random.uniform(-0.3, 0.3, (300, 2)) @ [1.0, 1.0j]
    actual, wanted = curve_of(ellipse, 96).nearest(points), ellipse.nearest(points)
    assert actual.gaps == pytest.approx(wanted.gaps, abs=1e-8)
    outside = wanted.gaps > 0.0
    assert actual.normals[outside] == pytest.approx(wanted.normals[outside], abs=1e-6)


def test_polygons_with_few_or_sharp_corners_or_long_faces_stay_polygons():
    few, many = regular_polygon(12, 0.02), regular_polygon(24, 0.15)
    face = many.faces_at(0)[0].length
    assert few.smoothed(1.0) is few
    assert many.smoothed(0.999 * face) is many
    assert isinstance(many.smoothed(1.001 * face), SmoothOutline)
    # One sharp corner.
    pointed = np.append(sampled(Disc(0.3), 48, 0.0).corners[:40], 0.1455 - 0.0972j)
    polygon = Polygon(tuple(zip(pointed.real, pointed.imag, strict=True)))
    assert polygon.smoothed(1.0) is polygon
