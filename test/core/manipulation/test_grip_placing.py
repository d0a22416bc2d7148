# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Poses of objects in contact with given members."""

import math

from held_grips import APART, AROUND, BOX, NINE
from hypothesis import assume, given, strategies
from isotruss_ros import core
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.depths import member_depths
import numpy as np
import pytest
import random_grips
import robots


def depths(config, grip):
    """Return the depths of the object in the straight members of a grip [m]."""
    names = config.robot.member_names
    return member_depths(config, grip.body)[[names.index(name) for name in grip.members]]


@robots.examples(30)
@given(robots.robots(('arch', 'ring')), robots.generators())
def test_penetrations_of_two_members_are_equal(robot, rng):
    config, grip = random_grips.random_convex_grip(robot, rng, 'tubes')
    assume(grip is not None)
    shape, angle = grip.body.shape, grip.body.pose.angle
    depth = float(rng.uniform(0.0, 0.02))
    try:
        placed = core.place_between(config, grip.members, shape, angle, depth)
    except GraspError:
        return
    assert placed.body.shape is shape
    assert placed.body.pose.angle == pytest.approx(angle)
    assert depths(config, placed) == pytest.approx(depth, abs=1e-9)


def test_penetrations_of_three_members_at_symmetry_are_equal():
    grip = core.place_between(NINE.home, AROUND, core.Disc(0.82), indentation=0.002)
    apart = -depths(NINE.home, grip)
    # The hole of the robot is a regular triangle, for a disc of 0.824 m.
    assert np.ptp(apart) < 1e-9
    assert apart[0] == pytest.approx(0.002, abs=1e-3)
    assert grip.members == AROUND
    assert len(core.reachable_twists(NINE.home, grip)) == 3


def test_objects_that_do_not_fit_are_refused():
    with pytest.raises(GraspError, match=r'reaches 0\.312062 m does not fit between'):
        core.place_between(NINE.home, ('south/X-P', 'north/Z-R'), BOX)
    with pytest.raises(GraspError, match='angle, indentation'):
        core.place_between(NINE.home, APART, BOX, np.nan)
    with pytest.raises(GraspError, match='no such members'):
        core.place_between(NINE.home, ('south/P-Q', 'north/R-X'), BOX)


@robots.examples(60)
@given(robots.robots(), robots.generators(), strategies.integers(0, 10**6))
def test_shift_from_the_tangent_center_indents_by_the_sine_of_half_the_angle(robot, rng, number):
    config, grip, ends = robots.random_grasp(robot, rng, number)
    module, shape = grip.members[0].split('-')[0], grip.body.shape
    center, shifted = (
        complex(*core.tangent_center(config, module, shape.diameter, shift))
        for shift in (0.0, 1e-3)
    )
    assert abs(shifted - center) == pytest.approx(1e-3)
    one, other = ends[1] - ends[0], ends[3] - ends[2]
    depth = 1e-3 * math.sin(0.5 * abs(np.angle(one / other)))
    placed = core.place_between(config, grip.members, shape, indentation=depth)
    assert placed.center == pytest.approx(shifted, abs=1e-9)


@pytest.mark.parametrize(
    ('module', 'diameter', 'shift', 'message'),
    [
        ('main/T', 10.0, 0.0, 'does not fit between the members main/T-'),
        ('main/T', -1.0, 0.0, 'must be from'),
        ('main/W', 0.2, 0.0, 'has no such module; did you mean main/'),
        ('main/T', 0.2, np.nan, 'shift'),
    ],
)
def test_discs_that_do_not_fit_at_a_module_are_refused(module, diameter, shift, message):
    with pytest.raises(GraspError, match=message):
        core.tangent_center(core.load_robot('triangle').home, module, diameter, shift)
