# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Grips of any two members, or three: what is one, and where the members touch."""

from hypothesis import assume, given, strategies
from isotruss_ros.core import (
    Configuration,
    ConvexObject,
    Disc,
    Grip,
    load_robot,
    place_between,
    Polygon,
    Pose,
    tangent_center,
)
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.manipulation.grip import find_contacts, find_members
import numpy as np
import pytest
import random_grips
import robots
import shapes

ROBOT = load_robot('nine_member')
DISC = ConvexObject.disc((0.0, 0.0), 0.3)
NAMES = ('south/P-Q', 'north/R-P')
TUBE = ROBOT.description.tube_diameter
BOX = Polygon([(0.0, 0.0), (0.2, 0.0), (0.2, 0.1), (0.0, 0.1)])


@pytest.mark.parametrize(
    'members',
    [
        (),
        'north/P-Z',
        ['north/P-Z'],
        ['north/P-Z', 'north/P-Z'],
        ['north/P-Z', 'north/R-P', 'north/Z-R', 'south/P-Q'],
    ],
)
def test_a_grip_has_two_or_three_different_members(members):
    with pytest.raises(GraspError, match='two or three different members'):
        Grip(members, DISC)


def test_friction_is_the_given_one_or_else_that_of_the_object():
    members = ['north/P-Z', 'north/Z-R']
    assert Grip(members, DISC).friction == 0.5
    assert Grip(members, ConvexObject(Disc(0.3)), 0.7).friction == 0.7
    assert Grip(members, ConvexObject(Disc(0.3), friction=0.2), 0.7).friction == 0.7
    assert Grip(members, ConvexObject(Disc(0.3), friction=0.2)).friction == 0.2
    for wrong in (-0.1, np.inf, np.nan):
        with pytest.raises(GraspError, match=r'must be (from 0 to 10|a finite number)'):
            Grip(members, DISC, wrong)


def test_members_are_those_of_the_robot():
    with pytest.raises(GraspError, match=r"members 'north/P-X': .*its members are south/P-Q"):
        find_contacts(ROBOT.home, Grip(['north/R-P', 'north/P-X'], DISC))


@pytest.mark.parametrize('module', ROBOT.module_names)
def test_a_grip_at_a_module_is_one_of_its_two_members(module):
    grip = Grip.at_module(ROBOT, module, DISC)
    tube, joint = module.split('/')
    assert grip.members[0].startswith(f'{module}-')
    assert grip.members[1].startswith(f'{tube}/')
    assert grip.members[1].endswith(f'-{joint}')
    assert grip.body is DISC


@pytest.mark.parametrize('unknown', ['north/X', 'Z', None])
def test_modules_are_those_of_the_robot(unknown):
    with pytest.raises(GraspError, match='no such module; its modules are south/P, '):
        Grip.at_module(ROBOT, unknown, DISC)


def test_a_member_that_does_not_touch_is_named():
    center = tangent_center(ROBOT.home, 'north/Z', 0.3)
    ahead, back = Grip.at_module(ROBOT, 'north/Z', DISC).members
    grip = Grip([ahead, back], ConvexObject.disc(center, 0.3))
    find_contacts(ROBOT.home, grip)
    third = next(name for name in ROBOT.member_names if 'Z' not in name)
    with pytest.raises(GraspError, match=f'member {third} does not touch the object at'):
        find_contacts(ROBOT.home, Grip([ahead, third], grip.body))
    # Off by less than the tube is thick it counts, and pressed in as much.
    for diameter, touches in ((0.11, True), (0.49, True), (0.09, False), (0.51, False)):
        other = Grip([ahead, back], ConvexObject.disc(center, diameter))
        if touches:
            find_contacts(ROBOT.home, other)
            continue
        with pytest.raises(GraspError, match=r'the gap is -?0\.10'):
            find_contacts(ROBOT.home, other)


@pytest.mark.parametrize(
    ('share', 'height', 'message'),
    [
        (0.01, 0.2, 'member north/P-Z'),
        (-0.01, 0.2, r'member north/Z-R .* would be at -0\.01 of its length'),
        (0.99, 0.2, 'member north/P-Z'),
        (1.01, 0.2, r'member north/Z-R .* would be at 1\.01 of its length'),
        (0.05, 0.4, r'member north/Z-R .* the gap is 0\.199 m'),
        # The disc is on neither side.
        (0.0, 0.0, 'member north/Z-R does not touch'),
    ],
)
def test_a_member_touches_between_its_ends_and_on_its_surface(share, height, message):
    start, end = robots.member_ends(ROBOT.home, 'north/Z-R')
    axis = (end - start) / abs(end - start)
    center = start + share * (end - start) + 1j * height * axis
    grip = Grip(['north/Z-R', 'north/P-Z'], ConvexObject.disc((center.real, center.imag), 0.3))
    with pytest.raises(GraspError, match=message):
        find_contacts(ROBOT.home, grip)


@robots.examples(40)
@given(
    strategies.data(), robots.generators(), strategies.sampled_from(['module', 'tube', 'tubes'])
)
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
    return Configuration(ROBOT, ROBOT.home.roller_positions.copy(), points)


def test_a_face_may_reach_beyond_the_end_of_a_member_and_not_lie_there():
    config = between((0.0, 1.0), ((0.1 + TUBE) * 1j, 2.0 + (0.1 + TUBE) * 1j))
    for x in (0.5, 0.85, 0.95, 0.99):
        body = ConvexObject(BOX, Pose(x, 0.5 * TUBE, 0.0))
        contacts = random_grips.contacts_of(config, Grip(NAMES, body))
        assert contacts.points.real == pytest.approx([x, x + 0.2, x + 0.2, x], abs=1e-12)
        assert contacts.points.imag == pytest.approx(
            0.5 * TUBE + np.array([0.0, 0.0, 0.1, 0.1]), abs=1e-12
        )
    for x, share in ((1.05, '1.05'), (-0.25, '-0.05')):
        body = ConvexObject(BOX, Pose(x, 0.5 * TUBE, 0.0))
        with pytest.raises(
            GraspError, match=f'{NAMES[0]} .* the contact would be at {share} of its'
        ):
            find_contacts(config, Grip(NAMES, body))


@pytest.mark.parametrize('aside', [0.2 + 0.2j, 0.2 - 0.2j, -0.2 + 0.2j, -0.2 - 0.2j])
def test_of_four_places_between_crossing_members_it_is_the_one_nearest_to_their_middle(aside):
    center = 0.3 - 0.2j
    config = between(
        (center + aside.real - 1.0, center + aside.real + 1.0),
        (center + 1j * (aside.imag - 1.0), center + 1j * (aside.imag + 1.0)),
    )
    grip = place_between(config, NAMES, Disc(0.3))
    away = 0.15 + 0.5 * TUBE
    wanted = center + complex(np.sign(aside.real), np.sign(aside.imag)) * away
    assert grip.center == pytest.approx(wanted, abs=1e-9)


def test_the_object_is_a_convex_object():
    with pytest.raises(GraspError, match='must be a ConvexObject'):
        Grip(['north/P-Z', 'north/Z-R'], Disc(0.3))
