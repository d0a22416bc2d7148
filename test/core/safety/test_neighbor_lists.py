# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bounds of an object's displacement, by which lists of near parts stay valid."""

from dataclasses import replace
import math

from hypothesis import given
from isotruss_ros.core import ConvexObject, Grip, Polygon
from isotruss_ros.core.model.convex_object import ORIGIN
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.safety.barriers import _bound_displacement
import numpy as np
import pytest
import robots
import shapes

MEMBERS = ('north/P-Z', 'north/Z-R')


def grip_of(shape, pose=ORIGIN, members=MEMBERS):
    """Return a grip of an object at a pose."""
    return Grip(members, ConvexObject(shape, pose), 0.5)


@robots.examples(60)
@given(robots.generators())
def test_the_bound_of_the_displacement_is_at_least_that_of_every_point(rng):
    shape = shapes.random_shape(rng)
    poses = [Pose(*(rng.uniform(-1.0, 1.0, 3) * (1.0, 1.0, 3.0))) for _ in range(2)]
    one, other = (grip_of(shape, pose) for pose in poses)
    points = shape.outline(0.01)
    moved = np.abs(
        one.body.center + one.body.turn * points - other.body.center - other.body.turn * points
    )
    bound = _bound_displacement(one, other)
    assert moved.max() <= bound + 1e-12
    turned = abs(one.body.turn - other.body.turn) * shape.reach
    assert bound == pytest.approx(abs(one.body.center - other.body.center) + turned)


@pytest.mark.parametrize(('one', 'other'), [((0, 1), (0, 2)), ((0, 2), (0, 1))])
def test_another_grip_or_shape_has_no_bound(one, other):
    names = (*MEMBERS, 'south/P-Q')
    shape = Polygon([(0.0, 0.0), (0.2, 0.0), (0.0, 0.2)])
    first, second = (
        grip_of(shape, members=tuple(names[i] for i in each)) for each in (one, other)
    )
    assert _bound_displacement(first, second) == math.inf
    larger = Polygon([(0.0, 0.0), (0.3, 0.0), (0.0, 0.2)])
    assert _bound_displacement(first, grip_of(larger, members=first.members)) == math.inf
    assert _bound_displacement(first, replace(first)) == 0.0
