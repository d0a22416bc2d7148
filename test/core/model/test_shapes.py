# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Convex shapes against their outlines, smooth curves through corners, and similar shapes."""

from functools import partial

from contracts import check_shape, directions
from held_grips import BOX
from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros import core
from isotruss_ros.core import ConvexObject, Disc, Ellipse, Polygon
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.model.convex_object import segment_gaps
from isotruss_ros.core.model.scaled_shape import ScaledShape
from isotruss_ros.core.model.shapes import PLANNED_DEPTH
from isotruss_ros.core.model.smooth_outline import SmoothOutline
import numpy as np
import pytest
import robots
from shapes import random_polygon, random_shape, regular_polygon, sampled, SHAPES

SEEDS = st.integers(0, 10**6)
SQUARE = ((-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1))
BEAM = Polygon(((-0.4, -0.02), (0.4, -0.02), (0.4, 0.02), (-0.4, 0.02)))
PENTAGRAM = [(np.cos(4 * np.pi * i / 5), np.sin(4 * np.pi * i / 5)) for i in range(5)]


@robots.examples(100)
@given(SEEDS)
def test_shapes_and_scaled_shapes_keep_the_contract_of_shapes(seed):
    generator = np.random.default_rng(seed)
    shape = random_shape(generator)
    check_shape(shape, generator)
    check_shape(ScaledShape(shape, 1.1), generator)


@robots.examples(100)
@given(SEEDS)
def test_vertices_may_have_either_orientation(seed):
    generator = np.random.default_rng(seed)
    polygon = random_polygon(generator)
    again = Polygon(polygon.vertices[::-1], tuple(polygon.radii[::-1]))
    points = 0.3 * directions(generator)
    one, other = polygon.nearest(points), again.nearest(points)
    assert one.gaps == pytest.approx(other.gaps, abs=1e-14)
    assert one.normals == pytest.approx(other.normals, abs=1e-12)
    assert hash(again) == hash(Polygon(again.vertices, again.corner_radius))


@given(st.floats(0.01, 1.0), st.floats(-4.0, 4.0))
def test_arcs_may_take_whole_sides(half, angle):
    square = half * np.exp(1j * (angle + 0.5 * np.pi * np.arange(4)))
    shape = Polygon(np.column_stack([square.real, square.imag]), half / np.sqrt(2.0))
    assert shape.perimeter == pytest.approx(np.sqrt(2.0) * np.pi * half)


#: Vertices of polygons that are not convex, and radii of corners that do not fit.
POLYGONS = [
    (3, 0.0, 'must be a list'),
    (((0, 0), (1, 0)), 0.0, 'of 2 vertices: must have at least 3'),
    (((0, 0), (1, [0]), (0, 1)), 0.0, 'vertex 2'),
    (((0, 0), (1, float('nan')), (0, 1)), 0.0, 'vertex 2'),
    (((0, 0), (1e10, 0), (0, 1)), 0.0, 'vertex 2 .* within'),
    (((0, 0), (1, 0), (1, 0), (0, 1)), 0.0, r'vertex 2 \(1, 0\) m: .* same position'),
    (((0, 0), (1, 0), (2, 0), (0, 1)), 0.0, r'vertex 2 \(1, 0\) m: on one line'),
    (((0, 0), (2, 0), (1, 0.2), (1, 2)), 0.0, r'vertex 3 \(1, 0.2\) m: .* concave'),
    (((0, 0), (1, 1), (1, 0), (0, 1)), 0.0, 'vertex 1 .* cross each other'),
    (PENTAGRAM, 0.0, 'cross each other'),
    (((0, 0), (1.2e-9, 0), (0, 1.2e-9)), 0.0, 'must be 1e-18 m\\^2 or more'),
    (SQUARE, -0.01, 'corner_radius -0.01 m: must be from 0 to 10 m'),
    (SQUARE, 0.11, 'does not fit: the side of 0.2 m that begins at vertex 1'),
    (SQUARE, (0.0, 0.15, 0.06, 0.0), r'that begins at vertex 2 \(0.1, -0.1\) m'),
    (SQUARE, (0.01, 0.01), 'must be 4 finite numbers'),
]


@pytest.mark.parametrize(
    ('make', 'words'),
    [
        *((partial(Polygon, vertices, radius), words) for vertices, radius, words in POLYGONS),
        (lambda: Disc(-1.0), 'must be from'),
        (lambda: Disc(0.99e-9), 'must be from'),
        (lambda: Ellipse((0.1, 0.0)), 'semi_axes'),
        (lambda: Ellipse((0.1, 1e-5)), 'factor'),
        (lambda: ConvexObject(Disc(0.1), (0.0, 0.0)), 'pose'),
        (lambda: ConvexObject(Disc(0.1), (1e13, 0.0, 0.0)), 'within'),
        (lambda: ConvexObject(Disc(0.1), mass=0.0), 'mass'),
        (lambda: ConvexObject(Disc(0.1), center_of_mass=(0.06, 0.0)), 'within the object'),
        (lambda: ConvexObject.disc((1.01e12, 0.0), 0.1), 'must be within'),
        (lambda: ConvexObject.disc((0.0, 0.0), 10.1), 'must be from'),
        (lambda: ConvexObject.disc((0.0, 0.0), np.inf), "the object's diameter .* finite number"),
    ],
)
def test_invalid_shapes_and_objects_are_refused_with_the_number(make, words):
    with pytest.raises(GraspError, match=words):
        make()


@pytest.mark.parametrize('shape', [*SHAPES, BEAM, Ellipse((0.3, 0.08))])
def test_gaps_of_segments_are_those_of_their_points(shape):
    rng = np.random.default_rng(1)
    share = np.linspace(0.0, 1.0, 4001)
    for _ in range(40):
        body = ConvexObject(shape, (*rng.normal(size=2), rng.uniform(0.0, 6.0)))
        start, end = body.middle + 0.4 * (rng.normal(size=2) + 1j * rng.normal(size=2))
        actual = segment_gaps(body, np.array([start]), np.array([end]))
        points = body.nearest(start + share * (end - start)).gaps
        if points.min() > 1e-3:
            assert actual.gaps[0] == pytest.approx(points.min(), abs=1e-4)
            place = start + actual.shares[0] * (end - start)
            nearest = body.nearest(np.array([place]))
            assert nearest.gaps[0] == pytest.approx(actual.gaps[0], abs=1e-9)
            assert actual.normals[0] == pytest.approx(nearest.normals[0], abs=1e-6)
        else:
            assert actual.gaps[0] < 2e-3


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


def test_a_scaled_box_has_the_contacts_of_the_box_with_scaled_corners():
    scaled = ScaledShape(BOX, 1.1)
    corners = (1.1 * np.array(BOX.vertices)).tolist()
    larger = core.Polygon(corners, corner_radius=1.1 * BOX.corner_radius)
    for angle in np.linspace(0.0, 6.0, 13):
        ends, expected = (s.contact_patch(np.exp(1j * angle), 0.05) for s in (scaled, larger))
        assert [end.corner for end in ends] == [end.corner for end in expected]
        assert [end.along for end in ends] == pytest.approx([end.along for end in expected])


@pytest.mark.parametrize('depth', [1e-4, 1e-3, 3e-3, 6e-3, 1.2e-2, 2e-2])
@pytest.mark.parametrize('tilt', [1e-7, 1e-5, 1e-3, 5e-3, 1e-2, 2e-2, 5e-2])
def test_both_corners_of_a_face_touch_if_they_are_within_the_depth_or_the_planned_depth(
    tilt, depth
):
    radius = 0.051
    for length, sign in ((0.24, 1.0), (0.24, -1.0), (0.95 * radius, 1.0)):
        shape = Polygon([(-0.5 * length, 0.0), (0.5 * length, 0.0), (0.0, 0.3)])
        normal = -1j * np.exp(1j * sign * tilt)
        skin = shape.support(np.array([normal]))[0] - depth
        patch = shape.contact_patch(normal, radius, skin)
        is_within = length * np.sin(tilt) <= max(depth, PLANNED_DEPTH * radius)
        assert len(patch) == 1 + (is_within and length > radius)
