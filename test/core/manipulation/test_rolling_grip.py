# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Objects that roll in grips, and faces that lift off members or stay on them."""

from dataclasses import replace
import itertools
import math

from grips import apart, drive, surface
from held_grips import APART, inclined_grip, NEAR, NINE, OFF, PENTAGON, sides
from hypothesis import assume, given
from hypothesis import strategies as st
from isotruss_ros import core
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.depths import member_depths
from isotruss_ros.core.manipulation.grip import find_contacts
from isotruss_ros.core.manipulation.grip_rows import contact_rows, grip_jacobian
from isotruss_ros.core.manipulation.rolling_off import rolled_corners
import numpy as np
import pytest
import random_grips
from random_grips import contacts_of
import robots
from scipy.linalg import null_space
from scipy.optimize import linprog

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
    grip = core.Grip(APART, DISC.moved_to((*DISC.pose[:2], angle)))
    pose = core.RollingGrip.attach(NINE.home, grip).pose
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
