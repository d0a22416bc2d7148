# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How far straight segments are from an object, against their points and in closed form."""

from isotruss_ros.core import ConvexObject, Disc, Ellipse, Polygon
from isotruss_ros.core.model.convex_object import segment_gaps
import numpy as np
import pytest

BOX = Polygon([(-0.15, -0.1), (0.15, -0.1), (0.15, 0.1), (-0.15, 0.1)], corner_radius=0.02)
SHAPES = [BOX, Ellipse((0.2, 0.12)), Disc(0.3), Polygon([(0.0, 0.0), (0.3, 0.05), (0.1, 0.25)])]


@pytest.mark.parametrize('shape', SHAPES)
def test_gaps_of_segments_are_those_of_their_points(shape):
    rng = np.random.default_rng(1)
    share = np.linspace(0.0, 1.0, 4001)
    for _ in range(40):
        body = ConvexObject(shape, (*rng.normal(size=2), rng.uniform(0.0, 6.0)))
        start, end = body.middle + 0.4 * (rng.normal(size=2) + 1j * rng.normal(size=2))
        found = segment_gaps(body, np.array([start]), np.array([end]))
        points = body.nearest(start + share * (end - start)).gaps
        if points.min() > 1e-3:
            assert found.gaps[0] == pytest.approx(points.min(), abs=1e-4)
            place = start + found.shares[0] * (end - start)
            nearest = body.nearest(np.array([place]))
            assert nearest.gaps[0] == pytest.approx(found.gaps[0], abs=1e-9)
            assert found.normals[0] == pytest.approx(nearest.normals[0], abs=1e-6)
        else:
            assert found.gaps[0] < 2e-3
        point = segment_gaps(body, np.array([start]), np.array([start]))
        assert point.gaps == pytest.approx(body.nearest(np.array([start])).gaps, abs=1e-12)


@pytest.mark.parametrize('shape', SHAPES)
def test_gap_directions_are_independent_of_the_direction_of_lines(shape):
    rng = np.random.default_rng(2)
    body = ConvexObject(shape, (1.0, -0.5, 2.0))
    starts, turned = body.middle + 0.4 * np.exp(1j * rng.uniform(0.0, 6.0, (2, 200)))
    found, back = segment_gaps(body, starts, turned), segment_gaps(body, turned, starts)
    inside = (found.shares > 0.0) & (found.shares < 1.0)
    assert inside.sum() > 100
    away = ((starts - body.middle) * found.normals.conj()).real[inside]
    assert away.min() >= 0.0
    reach = (
        shape.support(found.normals / body.turn)
        + ((body.center - body.middle) * found.normals.conj()).real
    )
    assert found.gaps[inside] == pytest.approx(away - reach[inside], abs=1e-12)
    assert back.gaps == pytest.approx(found.gaps, abs=1e-12)
    assert back.normals == pytest.approx(found.normals, abs=1e-12)
