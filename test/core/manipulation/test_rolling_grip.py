# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Objects that roll in grips, and commands for the middle of their interval."""

import math

from grips import apart, disc_grip, drive, surface
from held_grips import APART, NINE, PENTAGON
from hypothesis import assume, given, strategies
from isotruss_ros import core
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.manipulation.grip_rows import contact_rows
import numpy as np
import pytest
import random_grips
import robots

#: What the members have in common, and how many there are.
KINDS = (('module', 2), ('tube', 2), ('tubes', 2), ('tubes', 3))
#: Where a disc of half a metre touches both, in the hole between the three tubes.
CENTER = 0.4180504 - 0.2413615j
DISC = core.ConvexObject.disc((CENTER.real, CENTER.imag), 0.5)
#: About as large as a disc of half a metre.
ROUNDED = core.Polygon(PENTAGON.vertices, 0.02)


@pytest.mark.parametrize(
    'body',
    [
        # At this angle a normal passes half a turn in the object's frame.
        DISC.moved_to((CENTER.real, CENTER.imag, 0.523)),
        core.ConvexObject(core.Ellipse((0.25, 0.24)), core.Pose(CENTER.real, CENTER.imag, 0.3)),
        core.ConvexObject(ROUNDED, core.Pose(CENTER.real, CENTER.imag, 0.1)),
    ],
    ids=['disc', 'ellipse', 'rounded pentagon'],
)
def test_carries_and_turns_an_object_between_sides_that_do_not_meet(body):
    start = rolling = core.RollingGrip.attach(NINE.home, core.Grip(APART, body))
    assert len(core.reachable_twists(NINE.home, rolling.grip)) == 3
    wanted = np.array(start.pose)
    legs = [(0.02, 0.0, 0.0), (0.0, 0.02, 0.0), (0.0, 0.0, 0.1)]
    for twist in [*legs, *(-np.array(legs))]:
        rolling = drive(rolling, twist, 1.0)
        wanted += np.array(twist)
        assert apart(rolling.pose, wanted) == pytest.approx((0.0, 0.0), abs=2e-6)
        assert rolling.misfit < 1e-6
    assert apart(rolling.pose, start.pose) == pytest.approx((0.0, 0.0), abs=1e-6)


@pytest.mark.parametrize(('kind', 'count'), KINDS)
@robots.examples(10)
@given(strategies.data(), robots.generators(), strategies.booleans())
def test_the_object_moves_with_the_achieved_twist(kind, count, data, rng, flat):
    robot = data.draw(random_grips.robots_with(kind))
    config, grip = random_grips.random_convex_grip(robot, rng, kind, count, flat)
    assume(grip is not None)
    rolling = core.RollingGrip.attach(config, grip)
    assert apart(rolling.pose, grip.body.pose) == pytest.approx((0.0, 0.0), abs=1e-12)
    _, rigid = contact_rows(config, grip)
    assume(np.linalg.svd(rigid / surface(grip), compute_uv=False)[-1] > 0.02)
    command = core.solve_twist(config, grip, rng.standard_normal(3), limits=())
    size = np.abs(command.roller_velocities).max()
    assume(size > 1e-3)
    # One-sided differences: an object that rolls off a face does not roll back into it.
    step, rate = 1e-5 / size, -1.5 * np.array(rolling.pose)
    for steps, weight in ((1.0, 2.0), (2.0, -0.5)):
        travel = config.roller_positions + steps * step * command.roller_velocities
        after = rolling.moved_to(config.moved_to(travel))
        assert after.misfit < 1e-8
        pose = np.array(after.pose)
        pose[2] = rolling.pose[2] + np.angle(np.exp(1j * (pose[2] - rolling.pose[2])))
        rate += weight * pose
    rate /= step * size
    assert rate == pytest.approx(command.achieved_twist / size, abs=1e-5)


@pytest.mark.parametrize('angle', [3.3, -9.0])
def test_the_angle_of_a_rolling_object_is_within_half_a_turn(angle):
    pose = core.RollingGrip.attach(
        NINE.home, core.Grip(APART, DISC.moved_to((*DISC.pose[:2], angle)))
    ).pose
    assert pose.angle == pytest.approx(math.remainder(angle, 2.0 * math.pi), abs=1e-12)


def test_rollers_that_do_not_keep_the_contacts_show_as_a_misfit():
    rolling = core.RollingGrip.attach(NINE.home, core.Grip(APART, DISC))
    command = core.solve_twist(NINE.home, rolling.grip, np.zeros(3), opening_rate=0.01)
    assert np.abs(command.achieved_twist).max() < 1e-9
    opened = rolling.moved_to(NINE.home.moved_to(command.roller_velocities))
    # Either contact is off by half of what the members moved apart, along the line between them.
    assert 0.003 < opened.misfit < 0.006
    assert apart(opened.pose, rolling.pose)[0] < 1e-3


def test_an_object_that_left_the_members_is_refused():
    rolling = core.RollingGrip.attach(NINE.home, core.Grip(APART, DISC))
    far = NINE.home.moved_to([0.25, -0.3, 0.3, 0.2, -0.3, 0.25])
    with pytest.raises(GraspError, match='no pose of the object keeps its contacts'):
        rolling.moved_to(far)


HOME = core.load_robot('nine_member').home
MODULE = 'east/Q'
START = core.RollingGrip.attach(HOME, disc_grip(HOME, MODULE))
TWIST = np.array([0.02, 0.04, 0.15])


def opening(config):
    """Return the angle between the members at the grip's module."""
    b, b_end, c, c_end = robots.side_ends(config, MODULE)
    return abs(np.angle((c_end - c) / (b_end - b)))


def drift(rate, lead, seconds=2.0):
    """Return how far object and grip are from where a constant twist should have led them."""
    end = drive(START, TWIST, seconds, rate, lead)
    distance, angle = apart(end.pose, np.array(START.pose) + seconds * TWIST)
    return distance, angle, abs(opening(end.config) - opening(HOME))


def test_midpoint_rule_is_of_second_order_and_euler_of_first():
    first = np.array([drift(rate, 0.0) for rate in (10.0, 20.0)])
    second = np.array([drift(rate, 0.5 / rate) for rate in (10.0, 20.0)])
    assert first[0] / first[1] == pytest.approx([2.0, 2.0, 2.0], rel=0.1)
    # The robot is symmetric: what is left of one coordinate is rounding.
    assert (second[0] > 3.6 * second[1] - 1e-9).all()
    # At the same rate the midpoint is far ahead.
    assert (second[1] < 0.05 * first[1]).all()
