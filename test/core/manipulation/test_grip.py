# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Grips of two or three members, and their contacts."""

from hypothesis import assume, given, strategies
from isotruss_ros import core
from isotruss_ros.core.errors import GraspError, IsotrussError
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
BOX = core.Polygon([(0.0, 0.0), (0.2, 0.0), (0.2, 0.1), (0.0, 0.1)])


def test_friction_of_a_grip_takes_precedence_over_that_of_its_object():
    members = ['north/P-Z', 'north/Z-R']
    assert core.Grip(members, DISC).friction == 0.5
    assert core.Grip(members, core.ConvexObject(core.Disc(0.3)), 0.7).friction == 0.7
    assert core.Grip(members, core.ConvexObject(core.Disc(0.3), friction=0.2), 0.7).friction == 0.7
    assert core.Grip(members, core.ConvexObject(core.Disc(0.3), friction=0.2)).friction == 0.2


@pytest.mark.parametrize(
    ('members', 'body', 'message'),
    [
        ((), DISC, 'two or three different members'),
        ('north/P-Z', DISC, 'two or three different members'),
        (['north/P-Z', 'north/P-Z'], DISC, 'two or three different members'),
        (ROBOT.member_names[:4], DISC, 'two or three different members'),
        (['north/P-Z', 'north/Z-R'], core.Disc(0.3), 'must be a ConvexObject'),
        (['north/R-P', 'north/P-X'], DISC, "members 'north/P-X': .*its members are south/P-Q"),
    ],
)
def test_invalid_grips_are_refused(members, body, message):
    with pytest.raises(IsotrussError, match=message):
        find_contacts(ROBOT.home, core.Grip(members, body))


@pytest.mark.parametrize('module', ROBOT.module_names)
def test_a_grip_at_a_module_has_its_two_members(module):
    tube, joint = module.split('/')
    ahead, back = core.Grip.at_module(ROBOT, module, DISC).members
    assert ahead.startswith(f'{module}-')
    assert back.startswith(f'{tube}/')
    assert back.endswith(f'-{joint}')


@pytest.mark.parametrize('unknown', ['north/X', 'Z', None])
def test_modules_are_those_of_the_robot(unknown):
    with pytest.raises(GraspError, match=r'no such module; .*its modules are south/P, '):
        core.Grip.at_module(ROBOT, unknown, DISC)


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
    grip = core.Grip(
        ['north/Z-R', 'north/P-Z'], core.ConvexObject.disc((center.real, center.imag), 0.3)
    )
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
    return core.Configuration(ROBOT, ROBOT.home.roller_positions.copy(), points)


def test_a_face_touches_a_member_that_it_overlaps():
    config = between((0.0, 1.0), ((0.1 + TUBE) * 1j, 2.0 + (0.1 + TUBE) * 1j))
    grips = {
        x: core.Grip(NAMES, core.ConvexObject(BOX, core.Pose(x, 0.5 * TUBE, 0.0)))
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
