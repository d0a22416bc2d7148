"""Grips of any two members, or three: what is one, and where the members touch."""

from hypothesis import assume, given
from isotruss_ros.core import Cylinder, Grasp, GraspError, Grip, load_robot, tangent_center
from isotruss_ros.core.manipulation.grip import find_contacts
import numpy as np
import pytest
import random_grips
import robots

ROBOT = load_robot('nine_member')
DISC = Cylinder((0.0, 0.0), 0.3)


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


def test_members_are_those_of_the_robot():
    with pytest.raises(GraspError, match=r"members 'north/P-X': .*its members are south/P-Q"):
        find_contacts(ROBOT.home, Grip(['north/R-P', 'north/P-X'], DISC))


@pytest.mark.parametrize('module', ROBOT.module_names)
def test_a_grasp_at_a_module_is_a_grip_of_its_two_members(module):
    center = tangent_center(ROBOT.home, module, 0.3)
    grip = Grip.at_module(ROBOT, Grasp(module, center, 0.3))
    tube, joint = module.split('/')
    assert grip.members[0].startswith(f'{module}-')
    assert grip.members[1].startswith(f'{tube}/')
    assert grip.members[1].endswith(f'-{joint}')
    assert grip.body == Cylinder(center, 0.3)
    with pytest.raises(GraspError, match='no such module'):
        Grip.at_module(ROBOT, Grasp('north/X', center, 0.3))


@robots.examples(30)
@given(robots.robots(), robots.generators())
def test_contacts_are_the_points_of_the_disc_nearest_to_the_members(robot, rng):
    config, grip = random_grips.random_grip(robot, rng, 'module')
    assume(grip is not None)
    contacts = find_contacts(config, grip)
    center = complex(*grip.body.center)
    for k, name in enumerate(grip.members):
        start, end = random_grips.member_ends(config, name)
        line = start + np.linspace(0.0, 1.0, 20001) * (end - start)
        nearest = line[np.abs(line - center).argmin()]
        toward = (nearest - center) / abs(nearest - center)
        assert contacts.normals[k] == pytest.approx(toward, abs=1e-3)
        assert contacts.points[k] == pytest.approx(
            center + 0.5 * grip.body.diameter * contacts.normals[k], abs=1e-12
        )
        left = ((end - start).conjugate() * (center - start)).imag > 0.0
        assert contacts.sides[k] == (1.0 if left else -1.0)


def test_a_member_that_does_not_touch_is_named():
    center = tangent_center(ROBOT.home, 'north/Z', 0.3)
    ahead, back = Grip.at_module(ROBOT, Grasp('north/Z', center, 0.3)).members
    grip = Grip([ahead, back], Cylinder(center, 0.3))
    find_contacts(ROBOT.home, grip)
    third = next(name for name in ROBOT.member_names if 'Z' not in name)
    with pytest.raises(GraspError, match=f'member {third} does not touch the object at'):
        find_contacts(ROBOT.home, Grip([ahead, third], grip.body))
    # Off by less than the tube is thick it counts, and pressed in as much.
    for diameter, touches in ((0.11, True), (0.49, True), (0.09, False), (0.51, False)):
        other = Grip([ahead, back], Cylinder(center, diameter))
        if touches:
            find_contacts(ROBOT.home, other)
            continue
        with pytest.raises(GraspError, match=r'the gap is -?0\.10'):
            find_contacts(ROBOT.home, other)


def test_a_disc_beyond_the_end_of_a_member_is_not_touched():
    start, end = random_grips.member_ends(ROBOT.home, 'north/Z-R')
    axis = (end - start) / abs(end - start)
    for along, touches in ((0.01, True), (-0.01, False)):
        center = start + axis * (along + 0.2j)
        grip = Grip(['north/Z-R', 'north/P-Z'], Cylinder((center.real, center.imag), 0.3))
        if touches:
            with pytest.raises(GraspError, match='member north/P-Z'):
                find_contacts(ROBOT.home, grip)
        else:
            with pytest.raises(GraspError, match=r'north/Z-R .* it ends 0\.01 m before'):
                find_contacts(ROBOT.home, grip)
