# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How far a shape has rolled, against its outline."""

from hypothesis import given
from isotruss_ros.core import Disc, Ellipse, Polygon
import numpy as np
import pytest
import robots
import shapes


def arc(shape, angles):
    """Return the arcs to the points with given normals; of no face."""
    corners = [shape.corner_at(normal) for normal in np.exp(1j * angles).tolist()]
    return shape.unroll(angles, np.array(corners))


@robots.examples(40)
@given(robots.generators())
def test_unrolled_arcs_agree_with_outline_lengths(rng):
    shape = shapes.random_shape(rng)
    angles = np.sort(rng.uniform(-3.0, 3.0, 2))
    first, last = shape.support_points(np.exp(1j * angles))
    outline = shapes.dense_outline(shape, 40_000)
    begin, end = (np.abs(outline - point).argmin() for point in (first, last))
    steps = np.abs(np.roll(outline, -1) - outline)
    along = np.roll(steps, -begin)[: (end - begin) % len(outline)].sum()
    found = np.diff(arc(shape, angles))[0]
    slack = 3e-4 * shape.perimeter
    assert min(abs(found - along), abs(found - along + shape.perimeter)) < slack


@pytest.mark.parametrize(
    'shape',
    [
        Disc(0.3),
        Ellipse((0.3, 0.1)),
        Ellipse((0.1, 0.3)),
        Polygon([(0.0, 0.0), (0.4, 0.0), (0.1, 0.3)]),
        Polygon([(0.0, 0.0), (0.4, 0.0), (0.4, 0.3), (0.0, 0.3)], 0.05),
    ],
)
@pytest.mark.parametrize('turns', [-7, -1, 1, 3])
def test_a_whole_turn_unrolls_the_perimeter(shape, turns):
    angles = np.linspace(-3.1, 3.0, 41)
    after = arc(shape, angles + 2.0 * np.pi * turns)
    assert after - arc(shape, angles) == pytest.approx(turns * shape.perimeter, abs=1e-12)
    assert (np.diff(arc(shape, np.linspace(-20.0, 20.0, 1001))) >= -1e-12).all()
