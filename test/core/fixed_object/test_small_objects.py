# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Objects narrower than a tube, deep in it, have contact, or the refusal names the member."""

from held_grips import HOME, NINE
from isotruss_ros.core import analyze_grasp, ConvexObject, Disc, Ellipse, Polygon
from isotruss_ros.core.errors import SolverError
import numpy as np
import pytest
import robots

RADIUS = 0.5 * NINE.description.tube_diameter
NAME = 'south/P-Q'
BOX = Polygon([(-0.03, -0.02), (0.03, -0.02), (0.03, 0.02), (-0.03, 0.02)])
SHAPES = [Disc(0.07), Disc(0.02), Ellipse((0.03, 0.015)), BOX]


def placed(shape, depth, share):
    """Return an object this deep in a member, at a share of its length."""
    start, end = robots.member_ends(HOME, NAME)
    axis = (end - start) / abs(end - start)
    turn, outward = axis * np.exp(0.3j), 1j * axis
    reach = float(shape.support(np.array([outward / turn]))[0])
    center = start + share * (end - start) - outward * (RADIUS + reach - depth)
    return ConvexObject(shape, (center.real, center.imag, np.angle(turn)))


@pytest.mark.parametrize('shape', SHAPES, ids=repr)
@pytest.mark.parametrize('share', [0.1, 0.5, 0.98])
def test_deep_objects_touch_or_are_refused_with_the_member(shape, share):
    for depth in np.linspace(0.2, 0.99, 6) * (RADIUS + shape.reach):
        try:
            pressed = analyze_grasp(HOME, placed(shape, depth, share)).contact_forces
        except SolverError as error:
            pressed = str(error)
        assert NAME in pressed, f'{depth} m'


def test_an_object_deeper_than_a_diameter_of_the_tube_is_refused():
    with pytest.raises(SolverError, match='103 mm deep in it; must be at most 102 mm'):
        analyze_grasp(HOME, placed(Disc(0.3), 0.103, 0.5))
