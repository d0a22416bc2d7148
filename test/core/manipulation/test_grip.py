# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Grips of two or three members, their contacts, and poses of objects in contact."""

import math

from held_grips import APART, AROUND, BOX, NINE
from hypothesis import assume, given
from hypothesis import strategies as st
from isotruss_ros import core
from isotruss_ros.core.errors import GraspError, IsotrussError
from isotruss_ros.core.kinematics.depths import member_depths
from isotruss_ros.core.manipulation.grip import find_contacts, find_members
import numpy as np
import pytest
import random_grips
import robots
import shapes

ROBOT = core.load_robot('nine_member')
DISC = core.ConvexObject.disc((0.0, 0.0), 0.3)
NAMES = ('south/P-Q', 'north/R-P')
TUBE = ROBOT.description.tube_diameter
SMALL_BOX = core.Polygon([(0.0, 0.0), (0.2, 0.0), (0.2, 0.1), (0.0, 0.1)])


def test_friction_of_a_grip_takes_precedence_over_that_of_its_object():
    members = ['north/P-Z', 'north/Z-R']
    assert core.Grip(members, DISC).friction == 0.5
    assert core.Grip(members, core.ConvexObject(core.Disc(0.3)), 0.7).friction == 0.7
    assert core.Grip(members, core.ConvexObject(core.Disc(0.3), friction=0.2), 0.7).friction == 0.7
    assert core.Grip(members, core.ConvexObject(core.Disc(0.3), friction=0.2)).friction == 0.2


# The second member, which is checked after the first, does not touch.
@pytest.mark.parametrize(
    ('share', 'height', 'message'),
    [
        (0.01, 0.2, 'member north/P-Z'),
        (-0.01, 0.2, r'member north/Z-R .* would be at -0\.01 of its length'),
        (0.99, 0.2, 'member north/P-Z'),
        (1.01, 0.2, r'member north/Z-R .* would be at 1\.01 of its length'),
        (0.05, 0.295, 'member north/P-Z'),
        (0.05, 0.305, r'member north/Z-R .* the gap is 0\.10'),
        (0.05, 0.105, 'member north/P-Z'),
        (0.05, 0.095, r'member north/Z-R .* the gap is -0\.10'),
    ],
)
def test_a_member_touches_between_its_ends_within_a_tube_diameter(share, height, message):
    start, end = robots.member_ends(ROBOT.home, 'north/Z-R')
    axis = (end - start) / abs(end - start)
    center = start + share * (end - start) + 1j * height * axis
    body = core.ConvexObject.disc((center.real, center.imag), 0.3)
    grip = core.Grip(['north/Z-R', 'north/P-Z'], body)
    with pytest.raises(GraspError, match=message):
        find_contacts(ROBOT.home, grip)


@robots.examples(40)
@given(st.data(), robots.generators(), st.sampled_from(['module', 'tube', 'tubes']))
def test_contacts_are_the_points_of_the_surface_farthest_toward_the_members(data, rng, kind):
    robot = data.draw(random_grips.robots_with(kind))
    config, grip = random_grips.random_convex_grip(robot, rng, kind)
    assume(grip is not None)
    contacts = random_grips.contacts_of(config, grip)
    outline = grip.body.center + grip.body.turn * shapes.dense_outline(grip.body.shape)
    assert sorted(set(contacts.owners.tolist())) == [0, 1]
    for k, owner in enumerate(contacts.owners):
        start, end = robots.member_ends(config, grip.members[owner])
        heights = ((outline - start) * contacts.normals[k].conjugate()).real
        height = ((contacts.points[k] - start) * contacts.normals[k].conjugate()).real
        assert height == pytest.approx(heights.max(), abs=1e-4)
        assert np.abs(outline - contacts.points[k]).min() < 1e-3
        across = -1j * contacts.sides[k] * (end - start) / abs(end - start)
        assert contacts.normals[k] == pytest.approx(across, abs=1e-9)


def between(*members):
    """Return a configuration with two members in given places, whatever that does to others."""
    nodes, points = find_members(ROBOT.topology, NAMES), ROBOT.home.points.copy()
    for number, (start, end) in enumerate(members):
        points[nodes.lines[number]] = start, end
    return core.Configuration(ROBOT, ROBOT.home.roller_positions.copy(), points)


def test_a_face_touches_a_member_that_it_overlaps():
    config = between((0.0, 1.0), ((0.1 + TUBE) * 1j, 2.0 + (0.1 + TUBE) * 1j))
    grips = {
        x: core.Grip(NAMES, core.ConvexObject(SMALL_BOX, core.Pose(x, 0.5 * TUBE, 0.0)))
        for x in (0.99, 1.05)
    }
    contacts = random_grips.contacts_of(config, grips[0.99])
    assert contacts.points.real == pytest.approx([0.99, 1.19, 1.19, 0.99], abs=1e-12)
    with pytest.raises(GraspError, match=f'{NAMES[0]} .* the contact would be at 1.05 of its'):
        find_contacts(config, grips[1.05])


@pytest.mark.parametrize('aside', [0.2 + 0.2j, 0.2 - 0.2j, -0.2 + 0.2j, -0.2 - 0.2j])
def test_crossing_members_hold_an_object_on_the_side_of_their_middle(aside):
    center = 0.3 - 0.2j
    config = between(
        (center + aside.real - 1.0, center + aside.real + 1.0),
        (center + 1j * (aside.imag - 1.0), center + 1j * (aside.imag + 1.0)),
    )
    grip = core.place_between(config, NAMES, core.Disc(0.3))
    away = 0.15 + 0.5 * TUBE
    wanted = center + complex(np.sign(aside.real), np.sign(aside.imag)) * away
    assert grip.center == pytest.approx(wanted, abs=1e-9)


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


@robots.examples(60)
@given(robots.robots(), robots.generators(), st.integers(0, 10**6))
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


MEMBERS, ONE = ['north/P-Z', 'north/Z-R'], 'two or three different members'
TRIANGLE = core.load_robot('triangle').home
MODULES = r'no such module; .*its modules are south/P, '
REFUSED = [
    (ONE, lambda: core.Grip((), DISC)),
    (ONE, lambda: core.Grip('north/P-Z', DISC)),
    (ONE, lambda: core.Grip(['north/P-Z', 'north/P-Z'], DISC)),
    (ONE, lambda: core.Grip(ROBOT.member_names[:4], DISC)),
    ('must be a ConvexObject', lambda: core.Grip(MEMBERS, core.Disc(0.3))),
    (
        "members 'north/P-X': .*its members are south/P-Q",
        lambda: find_contacts(ROBOT.home, core.Grip(['north/R-P', 'north/P-X'], DISC)),
    ),
    (MODULES, lambda: core.Grip.at_module(ROBOT, 'north/X', DISC)),
    (MODULES, lambda: core.Grip.at_module(ROBOT, 'Z', DISC)),
    (MODULES, lambda: core.Grip.at_module(ROBOT, None, DISC)),
    (
        r'reaches 0\.312062 m does not fit between',
        lambda: core.place_between(NINE.home, ('south/X-P', 'north/Z-R'), BOX),
    ),
    ('angle, indentation', lambda: core.place_between(NINE.home, APART, BOX, np.nan)),
    ('no such members', lambda: core.place_between(NINE.home, ('south/P-Q', 'north/R-X'), BOX)),
    (
        'does not fit between the members main/T-',
        lambda: core.tangent_center(TRIANGLE, 'main/T', 10.0),
    ),
    ('must be from', lambda: core.tangent_center(TRIANGLE, 'main/T', -1.0)),
    ('did you mean main/', lambda: core.tangent_center(TRIANGLE, 'main/W', 0.2)),
    ('shift', lambda: core.tangent_center(TRIANGLE, 'main/T', 0.2, np.nan)),
]


@pytest.mark.parametrize(('words', 'call'), REFUSED)
def test_invalid_grips_and_places_are_refused_with_the_valid_ones(words, call):
    with pytest.raises(IsotrussError, match=words):
        call()
