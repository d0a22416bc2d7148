# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Objects narrower than a tube, deep in it: contact is found, or the member is refused by name."""

from held_grips import HOME, NINE
from isotruss_ros.core import analyze_grasp, ConvexObject, Disc, Ellipse, Polygon
from isotruss_ros.core.errors import SolverError
import numpy as np
import pytest
import robots

RADIUS = 0.5 * NINE.description.tube_diameter
NAME = 'south/P-Q'
SHAPES = [
    Disc(0.07),
    Disc(0.02),
    Ellipse((0.03, 0.015)),
    Polygon([(-0.03, -0.02), (0.03, -0.02), (0.03, 0.02), (-0.03, 0.02)]),
]


def placed(shape, depth, share):
    """Return an object this deep in a member, at a share of its length."""
    start, end = robots.member_ends(HOME, NAME)
    axis = (end - start) / abs(end - start)
    turn, outward = axis * np.exp(0.3j), 1j * axis
    reach = float(shape.support(np.array([outward / turn]))[0])
    center = start + share * (end - start) - outward * (RADIUS + reach - depth)
    return ConvexObject(shape, (center.real, center.imag, np.angle(turn)))


def touched(config, body):
    """Return the members that press, or the reason of the refusal."""
    try:
        return ' '.join(analyze_grasp(config, body).contact_forces)
    except SolverError as error:
        return str(error)


@pytest.mark.parametrize('shape', SHAPES, ids=repr)
@pytest.mark.parametrize('share', [0.1, 0.5, 0.98])
def test_deep_objects_touch_or_are_refused_with_the_member(shape, share):
    reach = shape.reach
    for depth in np.linspace(0.2, 0.99, 6) * (RADIUS + reach):
        body = placed(shape, depth, share)
        found = touched(HOME, body)
        assert NAME in found, f'{depth} m'


def test_object_without_penetration_is_accepted():
    body = placed(Disc(0.07), -0.001, 0.5)
    assert not analyze_grasp(HOME, body).contact_forces
