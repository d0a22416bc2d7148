# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Polygons with many corners are held as the discs and ellipses on which these are."""

from functools import cache
from itertools import product

from held_grips import NINE
from isotruss_ros.core import ConvexObject, Disc, Ellipse, place_between, settle_grasp
from isotruss_ros.core.errors import GraspError
from nightly import some_now
import numpy as np
import pytest
from shapes import sampled

FRICTION = 0.9
MEMBERS = [('north/P-Z', 'north/Z-R'), ('south/P-Q', 'north/R-P'), ('east/R-Y', 'east/Q-R')]
SMOOTH = [Disc(0.3), Ellipse((0.15, 0.1)), Ellipse((0.1, 0.14))]
SQUEEZES = (0.003, 0.006, 0.012, 0.02)
#: Shift of the polygon's frame in the object [m].
AWAY = 0.05 - 0.02j


@cache
def held(seed, shape):
    """Return a random configuration with a smooth object in it that is held, and its members."""
    random = np.random.default_rng(seed)
    while True:
        config = NINE.configuration(random.uniform(-0.15, 0.15, 6))
        members = MEMBERS[random.integers(len(MEMBERS))]
        angle, depth = random.uniform(0.0, 2.0 * np.pi), SQUEEZES[seed % len(SQUEEZES)]
        try:
            body = place_between(config, members, shape, angle, depth).body
        except GraspError:
            continue
        grasp = settle_grasp(config, body, FRICTION, members=members)
        if grasp.equilibrium is not None and abs(grasp.slip_margin) > 0.1:
            return config, body, members, grasp, random.uniform(0.0, 2.0 * np.pi)


@pytest.mark.parametrize(
    ('count', 'seed', 'shape'),
    some_now(
        dict.fromkeys([*product([24], [3], SMOOTH), *product((24, 96), range(4), SMOOTH)]),
        len(SMOOTH),
    ),
    ids=repr,
)
def test_slip_margin_is_that_of_the_smooth_shape_within_one_percent(count, seed, shape):
    config, body, members, smooth, begin = held(seed, shape)
    polygon = sampled(shape, count, begin, AWAY)
    center = body.center - body.turn * AWAY
    there = ConvexObject(polygon, (center.real, center.imag, body.pose.angle))
    grasp = settle_grasp(config, there, FRICTION, members=members)
    assert grasp.hold is smooth.hold
    assert grasp.slip_margin == pytest.approx(smooth.slip_margin, rel=0.01)
    for name, force in smooth.normal_forces.items():
        assert grasp.normal_forces[name] == pytest.approx(force, rel=0.01)
