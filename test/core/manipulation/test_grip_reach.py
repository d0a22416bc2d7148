"""A polygon rolls off a face that lies on a member: where statics has a balance for it."""

from hypothesis import assume, given, strategies
from isotruss_ros.core import (
    ConvexObject,
    Grip,
    load_robot,
    Polygon,
    Pose,
    reachable_twists,
    RollingGrip,
    solve_twist,
    Status,
)
from isotruss_ros.core.manipulation.grip_contacts import find_contacts
from isotruss_ros.core.manipulation.grip_reach import rolled_corners
from isotruss_ros.core.manipulation.grip_rows import contact_rows
import numpy as np
import pytest
import random_grips
import robots
from scipy.optimize import linprog

NINE = load_robot('nine_member')
#: Two sides of different tubes, which meet at no module.
APART = ('south/P-Q', 'north/R-P')
NEAR = 0.42 - 0.24j
#: Without these rollers a face that lies on a member keeps the object from turning alone.
FAILED = ('south/Q', 'east/R')
CORNERS = 0.26 * np.exp(2j * np.pi * np.arange(5) / 5)
PENTAGON = Polygon(CORNERS.view(float).reshape(-1, 2))


def inclined_grip(inclined, friction):
    """Return a pentagon between two sides, a face inclined against the first one [rad]."""
    ends = [random_grips.member_ends(NINE.home, name) for name in APART]
    normals = np.array([random_grips.toward(NEAR, *e) for e in ends])
    turn = normals[0] / PENTAGON.normals[0] * np.exp(1j * inclined)
    reach = PENTAGON.support(normals / turn) + 0.041
    starts = np.array([start for start, _ in ends])
    away = ((starts - NEAR) * normals.conj()).real - reach
    x, y = np.linalg.solve(normals.view(float).reshape(2, 2), away)
    place = NEAR + complex(x, y)
    pose = Pose(place.real, place.imag, float(np.angle(turn)))
    return Grip(APART, ConvexObject(PENTAGON, pose), friction)


def inclination(rolling):
    """Return how far the face is from lying on the first member [rad]."""
    ends = random_grips.member_ends(rolling.config, APART[0])
    normal = random_grips.toward(rolling.grip.body.middle, *ends)
    return float(np.angle(normal / (PENTAGON.normals[0] * rolling.grip.body.turn)))


def lifting(grip, command):
    """Return the speeds (k,) at which contacts move off their members [m/s]."""
    contacts, hand, rigid = contact_rows(NINE.home, grip)
    off = rigid @ command.achieved_twist - hand @ command.roller_velocities
    return (off.view(complex) * -contacts.normals.conj()).real


@pytest.mark.parametrize(('friction', 'rolls'), [(0.0, False), (0.5, False), (1.0, True)])
def test_a_face_lifts_at_one_end_where_forces_at_the_other_balance(friction, rolls):
    grip = inclined_grip(0.0, friction)
    assert len(reachable_twists(NINE.home, grip, FAILED)) == 2
    command = solve_twist(NINE.home, grip, [0.0, 0.0, 0.02], FAILED)
    off = lifting(grip, command)
    if rolls:
        assert command.status is Status.OK
        assert command.achieved_twist == pytest.approx([0.0, 0.0, 0.02], abs=1e-9)
        assert sorted(np.abs(off) > 1e-3) == [False, False, True]
        assert off.max() > 1e-3
    else:
        assert command.status is Status.UNREACHABLE
        assert off == pytest.approx(0.0, abs=1e-9)
    assert command.reachable_dof == (3 if rolls else 2)
    # The other way around it would have to roll over the other end, for which there is none.
    command = solve_twist(NINE.home, grip, [0.0, 0.0, -0.02], FAILED)
    assert command.status is Status.UNREACHABLE
    assert lifting(grip, command) == pytest.approx(0.0, abs=1e-9)


def test_the_slowest_turn_there_is_moves_nothing():
    """Rolling would reach it, but its surface speed is less than any number but zero."""
    grip = inclined_grip(0.0, 1.0)
    assert solve_twist(NINE.home, grip, [0.0, 0.0, 1e-300], FAILED).status is Status.OK
    assert not solve_twist(NINE.home, grip, [0.0, 0.0, 5e-324], FAILED).roller_velocities.any()


@pytest.mark.parametrize(('friction', 'rolls'), [(0.0, False), (1.0, True)])
def test_a_polygon_rolls_across_a_face_or_stops_on_it(friction, rolls):
    rolling = RollingGrip.attach(NINE.home, inclined_grip(-0.01, friction))
    before = inclination(rolling)
    for _ in range(100):
        command = solve_twist(rolling.config, rolling.grip, [0.0, 0.0, 0.05], FAILED)
        travel = rolling.config.roller_positions + 0.02 * command.roller_velocities
        rolling = rolling.moved_to(rolling.config.moved_to(travel))
    assert before == pytest.approx(0.01, abs=1e-9)
    # In the window in which a face counts as lying on a member either end may be the last.
    assert rolling.misfit < 3e-4
    if rolls:
        assert command.status < Status.UNREACHABLE
        assert inclination(rolling) < -0.02
    else:
        assert command.status is Status.UNREACHABLE
        assert 0.0 < inclination(rolling) < 2e-3


def balance_exists(contacts, kept, friction):
    """Tell by a linear program whether contacts have forces in their cones that balance."""
    wrenches, pressing = [], []
    for k in kept:
        for sign in (1.0, -1.0):
            force = -contacts.normals[k] * (1.0 + sign * 1j * friction)
            moment = (contacts.points[k].conjugate() * force).imag
            wrenches.append([force.real, force.imag, moment])
            pressing.append(1.0)
    equal = np.vstack([np.array(wrenches).T, pressing])
    found = linprog(np.zeros(len(pressing)), A_eq=equal, b_eq=[0.0, 0.0, 0.0, 1.0])
    return found.status == 0


@robots.examples(40)
@given(strategies.data(), robots.generators(), strategies.sampled_from(['module', 'tubes']))
def test_corners_are_rolled_over_where_a_linear_program_finds_a_balance(data, rng, kind):
    robot = data.draw(random_grips.robots_with(kind))
    config, grip = random_grips.random_convex_grip(robot, rng, kind, 2, flat=True)
    assume(grip is not None)
    contacts, friction = find_contacts(config, grip), float(rng.uniform(0.05, 1.5))
    assume(contacts.owners.tolist() == [0, 0, 1])
    found = list(rolled_corners(contacts, friction))
    for kept in ((0, 2), (1, 2)):
        # Not at the edge of a cone, where rounding decides.
        sure = {balance_exists(contacts, kept, friction * change) for change in (0.999, 1.001)}
        if len(sure) == 1:
            assert (kept in found) == sure.pop()
    assert (0, 1, 2) not in found


def test_a_box_on_three_members_stays_on_its_faces():
    rng = np.random.default_rng(3)
    grip = None
    while grip is None:
        config, grip = random_grips.random_convex_grip(NINE, rng, 'tubes', 3, flat=True)
    contacts = find_contacts(config, grip)
    assert len(contacts.owners) > 3
    assert list(rolled_corners(contacts, 1.0)) == []
