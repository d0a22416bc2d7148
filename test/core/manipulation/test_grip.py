# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Grips: contacts, objects that roll in them, and faces that lift off members or stay on them."""

from dataclasses import replace
import itertools
import math

from grips import apart, drive, surface
from held_grips import APART, AROUND, BOX, inclined_grip, NEAR, NINE, OFF, PENTAGON, sides
from hypothesis import assume, given
from hypothesis import strategies as st
from isotruss_ros import core
from isotruss_ros.core.errors import GraspError, IsotrussError
from isotruss_ros.core.kinematics.depths import member_depths
from isotruss_ros.core.manipulation.grip import find_contacts, find_members
from isotruss_ros.core.manipulation.grip_rows import contact_rows, grip_jacobian
from isotruss_ros.core.manipulation.rolling_off import rolled_corners
import numpy as np
import pytest
import random_grips
from random_grips import contacts_of
import robots
from scipy.linalg import null_space
from scipy.optimize import linprog
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


#: What the members have in common, and how many there are.
KINDS = (('module', 2), ('tube', 2), ('tubes', 2), ('tubes', 3))
#: Where a disc of half a metre touches both, in the hole between the three tubes.
CENTER = 0.4180504 - 0.2413615j
LARGE_DISC = core.ConvexObject.disc((CENTER.real, CENTER.imag), 0.5)
#: About as large as a disc of half a metre.
ROUNDED = core.Polygon(PENTAGON.vertices, 0.02)


@pytest.mark.parametrize(
    'body',
    [
        # At this angle a normal passes half a turn in the object's frame.
        LARGE_DISC.moved_to((CENTER.real, CENTER.imag, 0.523)),
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
@given(st.data(), robots.generators(), st.booleans())
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
    grip = core.Grip(APART, LARGE_DISC.moved_to((*LARGE_DISC.pose[:2], angle)))
    pose = core.RollingGrip.attach(NINE.home, grip).pose
    assert pose.angle == pytest.approx(math.remainder(angle, 2.0 * math.pi), abs=1e-12)


def test_rollers_that_do_not_keep_the_contacts_show_as_a_misfit():
    rolling = core.RollingGrip.attach(NINE.home, core.Grip(APART, LARGE_DISC))
    command = core.solve_twist(NINE.home, rolling.grip, np.zeros(3), opening_rate=0.01)
    assert np.abs(command.achieved_twist).max() < 1e-9
    opened = rolling.moved_to(NINE.home.moved_to(command.roller_velocities))
    # Either contact is off by half of what the members moved apart, along the line between them.
    assert 0.003 < opened.misfit < 0.006
    assert apart(opened.pose, rolling.pose)[0] < 1e-3


def test_an_object_that_left_the_members_is_refused():
    rolling = core.RollingGrip.attach(NINE.home, core.Grip(APART, LARGE_DISC))
    far = NINE.home.moved_to([0.25, -0.3, 0.3, 0.2, -0.3, 0.25])
    with pytest.raises(GraspError, match='no pose of the object keeps its contacts'):
        rolling.moved_to(far)


#: Without these rollers a face that lies on a member keeps the object from turning alone.
FAILED = ('south/Q', 'east/R')


def inclination(rolling):
    """Return how far the face is from lying on the first member [rad]."""
    ends = robots.member_ends(rolling.config, APART[0])
    normal = random_grips.toward(rolling.grip.body.middle, *ends)
    return float(np.angle(normal / (PENTAGON.normals[0] * rolling.grip.body.turn)))


def balance_exists(contacts, kept, friction):
    """Return whether a linear program finds forces within the friction cones that balance."""
    wrenches, pressing = [], []
    for k in kept:
        for sign in (1.0, -1.0):
            force = -contacts.normals[k] * (1.0 + sign * 1j * friction)
            moment = (contacts.points[k].conjugate() * force).imag
            wrenches.append([force.real, force.imag, moment])
            pressing.append(1.0)
    equal = np.vstack([np.array(wrenches).T, pressing])
    solution = linprog(np.zeros(len(pressing)), A_eq=equal, b_eq=[0.0, 0.0, 0.0, 1.0])
    return solution.status == 0


def test_faces_on_both_members_keep_the_angle_between_them():
    starts, axes, normals = sides()
    feet = normals * (((starts - NEAR) * normals.conj()).real - OFF)
    corners = np.concatenate([feet - 0.1 * axes, feet + 0.1 * axes])
    corners = corners[np.argsort(np.angle(corners))]
    shape = core.Polygon(corners.view(float).reshape(-1, 2))
    grip = core.Grip(APART, core.ConvexObject(shape, core.Pose(NEAR.real, NEAR.imag, 0.0)))
    assert contacts_of(NINE.home, grip).owners.tolist() == [0, 0, 1, 1]
    jacobian, (hand, rigid) = grip_jacobian(NINE.home, grip), contact_rows(NINE.home, grip)
    # Motions with zero in the last three rows keep all contacts, and there are no others.
    kept = null_space(jacobian[3:], rcond=1e-9)
    assert hand @ kept == pytest.approx(rigid @ jacobian[:3] @ kept, abs=1e-11)
    assert kept.shape[1] == null_space(np.hstack([hand, -rigid]), rcond=1e-9).shape[1] == 3


def test_named_contacts_of_a_grip_are_kept_in_rolling():
    for inclined, ends in itertools.product((0.0, 0.03), ([0], [0, 1])):
        named = replace(inclined_grip(inclined, 0.5), corners=(tuple(ends), (4,)))
        rolling = core.RollingGrip.attach(NINE.home, named)
        for each in (rolling, rolling.moved_to(NINE.home)):
            assert each.corners.tolist() == [*ends, 4]
            assert each.pose == pytest.approx(named.body.pose, abs=1e-12)


def lifting(grip, command):
    """Return the speeds (k,) at which contacts move off their members [m/s]."""
    hand, rigid = contact_rows(NINE.home, grip)
    slip = (rigid @ command.achieved_twist - hand @ command.roller_velocities).view(complex)
    return (slip * -contacts_of(NINE.home, grip).normals.conj()).real


@pytest.mark.parametrize(('friction', 'rolls'), [(0.0, False), (0.5, False), (1.0, True)])
def test_a_face_lifts_at_one_end_where_forces_at_the_other_balance(friction, rolls):
    grip = inclined_grip(0.0, friction)
    assert len(core.reachable_twists(NINE.home, grip, FAILED)) == 2
    command = core.solve_twist(NINE.home, grip, [0.0, 0.0, 0.02], FAILED)
    off = lifting(grip, command)
    if rolls:
        assert command.status is core.Status.OK
        assert command.achieved_twist == pytest.approx([0.0, 0.0, 0.02], abs=1e-9)
        assert sorted(np.abs(off) > 1e-3) == [False, False, True]
        assert off.max() > 1e-3
    else:
        assert command.status is core.Status.UNREACHABLE
        assert off == pytest.approx(0.0, abs=1e-9)
    assert command.reachable_dof == (3 if rolls else 2)
    # The other way around it would have to roll over the other end, for which there is none.
    command = core.solve_twist(NINE.home, grip, [0.0, 0.0, -0.02], FAILED)
    assert command.status is core.Status.UNREACHABLE
    assert lifting(grip, command) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(('friction', 'rolls'), [(0.0, False), (1.0, True)])
def test_a_polygon_rolls_across_a_face_or_stops_on_it(friction, rolls):
    rolling = core.RollingGrip.attach(NINE.home, inclined_grip(-0.01, friction))
    before = inclination(rolling)
    for _ in range(100):
        command = core.solve_twist(rolling.config, rolling.grip, [0.0, 0.0, 0.05], FAILED)
        travel = rolling.config.roller_positions + 0.02 * command.roller_velocities
        rolling = rolling.moved_to(rolling.config.moved_to(travel))
    assert before == pytest.approx(0.01, abs=1e-9)
    # In the planned indentation either end of the face may be the last.
    assert rolling.misfit < 1.1e-3
    if rolls:
        assert command.status < core.Status.UNREACHABLE
        assert inclination(rolling) < -0.02
    else:
        assert command.status is core.Status.UNREACHABLE
        assert 0.0 < inclination(rolling) < 4e-3


@robots.examples(40)
@given(st.data(), robots.generators(), st.sampled_from(['module', 'tubes']))
def test_corners_are_rolled_over_where_a_linear_program_finds_a_balance(data, rng, kind):
    robot = data.draw(random_grips.robots_with(kind))
    config, grip = random_grips.random_convex_grip(robot, rng, kind, 2, flat=True)
    assume(grip is not None)
    contacts, friction = contacts_of(config, grip), float(rng.uniform(0.05, 1.5))
    assume(contacts.owners.tolist() == [0, 0, 1])
    touching = find_contacts(config, grip)
    choices = [tuple(map(touching.index, c)) for c in rolled_corners(touching, friction)]
    for kept in ((0, 2), (1, 2)):
        # Not at the edge of a cone, where rounding decides.
        sure = {balance_exists(contacts, kept, friction * change) for change in (0.999, 1.001)}
        if len(sure) == 1:
            assert (kept in choices) == sure.pop()
    assert (0, 1, 2) not in choices


@pytest.mark.parametrize(
    ('seed', 'kind'), [(7, 'tubes'), (112, 'module'), (240, 'module'), (242, 'module')]
)
def test_a_polygon_that_rolls_penetrates_its_members_by_no_more_than_its_misfit(seed, kind):
    rng = np.random.default_rng(seed)
    config, grip = random_grips.random_convex_grip(NINE, rng, kind, 2, flat=True)
    members = [NINE.member_names.index(name) for name in grip.members]
    travel = config.roller_positions + 0.02 * rng.standard_normal(len(NINE.roller_names))
    rolled = core.RollingGrip.attach(config, grip).moved_to(config.moved_to(travel))
    before, after = (
        member_depths(at, body)[members]
        for at, body in ((config, grip.body), (rolled.config, rolled.grip.body))
    )
    assert (after - before).max() <= rolled.misfit + 1e-9
