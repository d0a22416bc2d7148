# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The acceleration of the rollers is limited in every mode, and halts are immediate."""

from dataclasses import replace

from driven import Driven
from grips import disc_grip, held_at
from hypothesis import given, reject
from hypothesis import strategies as st
from isotruss_ros.core import load_robot, solve_twist, Status
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.held_grip import NotHeldError
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.acceleration import limit_acceleration
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.manipulation.limits import default_limits, Rows, stack_rows
from nightly import some_now
import numpy as np
import pytest
from robots import examples, KINDS, random_robot
from scipy.optimize import linprog

ROBOT = load_robot('nine_member')
N = len(ROBOT.roller_names)
ACCELERATION = ROBOT.description.max_acceleration
PERIOD = 0.01
CHANGE = ACCELERATION * PERIOD
GRIP = disc_grip(ROBOT.home, 'north/R', 0.3)
ROWS = stack_rows(ROBOT.home, default_limits(ROBOT))
#: Smallest change of a roller's speed forth and back that counts as a reversal [m/s].
REVERSAL = 1e-3


def driven(module, robot=ROBOT, **settings):
    return Driven(held_at(robot.home, module), PERIOD, **settings)


def heading(degrees, speed=0.05):
    return speed * np.array([np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees)), 0.0])


CASES = [
    (module, first, slide, rate)
    for slide in (True, False)
    for rate in (4.0, 0.25)
    for module, first in (('north/Z', 110.0), ('north/R', 30.0), ('east/Q', 200.0))
]


def can_avoid_reversals(command, previous, step, rows, velocities):
    """Return whether other admissible roller speeds move the object alike without reversals."""
    kept = np.concatenate([command.motion, command.contact_rows])
    sides = np.concatenate([rows.matrix, -rows.matrix])
    room = np.concatenate([rows.upper, -rows.lower])
    least = np.where(step > REVERSAL, -REVERSAL, -CHANGE)
    largest = np.where(step < -REVERSAL, REVERSAL, CHANGE)
    bounds = previous[:, None] + np.stack([least, largest], axis=1)
    finite = np.isfinite(room)
    result = linprog(np.zeros(N), sides[finite], room[finite], kept, kept @ velocities, bounds)
    return result.status != 2  # infeasible


@pytest.mark.parametrize(('module', 'first', 'slide', 'rate'), some_now(CASES, 1))
def test_a_turning_twist_at_a_limit_keeps_the_acceleration(module, first, slide, rate):
    robot, speeds = driven(module, slide_along_limits=slide), []
    for cycle in range(150):  # in longer cycles to where the limit is near
        command = robot.step(heading(first), 20.0 * PERIOD)
        if cycle > 10 and command.scale < 0.5:
            break
    robot.step(heading(first))
    for turned in np.arange(0.0, 120.0, rate):
        command = robot.step(heading(first + turned))
        assert command.status < Status.HALT_NO_TWIST
        assert robot.change <= CHANGE * (1.0 + 1e-6)
        speeds.append(np.linalg.norm(command.achieved_twist[:2]))
    assert np.abs(np.diff(speeds)).max() <= 6e-3


def largest_object_change(robot, first, period=PERIOD, **approach):
    """Turn a twist by 2 degrees a cycle near a limit; return the largest change [m/s^2]."""
    for cycle in range(150):
        command = robot.step(heading(first), 20.0 * PERIOD)
        if cycle > 10 and command.scale < approach.get('scale', 0.0):
            break
    weights, before = np.array([1.0, 1.0, robot.held.grip.body.arm]), None
    largest = 0.0
    for turned in np.arange(0.0, 240.0, 2.0):
        command = robot.step(heading(first + turned), period)
        velocity = weights * command.achieved_twist
        if before is not None:
            largest = max(largest, np.linalg.norm(velocity - before) / period)
        before = velocity
    return largest


@pytest.mark.parametrize(
    ('scale', 'slide'), some_now([(0.0, True), (0.5, True), (0.0, False), (0.5, False)], 2)
)
def test_the_object_keeps_its_acceleration_while_a_twist_turns_near_a_limit(scale, slide):
    robot = driven('north/Z', slide_along_limits=slide)
    assert largest_object_change(robot, 110.0, scale=scale) <= 0.6


@pytest.mark.parametrize('bound', [0.1, 2.0])
def test_the_acceleration_of_the_object_is_a_setting(bound):
    robot = driven('north/R', max_object_acceleration=bound)
    robot.step(np.zeros(3))
    commands = [robot.step(heading(30.0)) for _ in range(3)]
    velocity = np.linalg.norm(commands[-1].achieved_twist[:2])
    assert robot.change <= CHANGE * (1.0 + 1e-6)
    if bound == 0.1:
        assert velocity == pytest.approx(3.0 * bound * PERIOD, rel=0.02)
        assert commands[-1].status is Status.ACCELERATING
    else:
        assert velocity > 3.0 * 0.5 * PERIOD


@examples(12)
@given(st.integers(0, 2**31), st.sampled_from(KINDS), st.floats(0.0, 360.0))
def test_the_object_of_any_robot_keeps_its_acceleration_while_a_twist_turns(seed, kind, first):
    robot = random_robot(seed, kind)
    module = str(np.random.default_rng(seed).choice(robot.module_names))
    try:
        held = held_at(robot.home, module)
    except (GraspError, NotHeldError):
        reject()
    assert largest_object_change(Driven(held, PERIOD), first) <= 0.6


@examples(50)
@given(st.integers(0, 2**31))
def test_rollers_reverse_only_as_the_twist_requires(seed):
    rng = np.random.default_rng(seed)
    twist = 0.05 * rng.standard_normal(3)
    command = solve_twist(ROBOT.home, GRIP, twist)
    share = rng.uniform(0.7, 1.3)
    previous = solve_twist(ROBOT.home, GRIP, share * twist).roller_velocities
    change, step, roller = command.roller_velocities - previous, np.zeros(N), rng.integers(N)
    step[roller] = -CHANGE * np.sign(change[roller])
    limited = limit_acceleration(command, previous, step, CHANGE, lambda: ROWS)
    velocities = limited.roller_velocities
    assert command.contact_rows @ velocities == pytest.approx(0.0, abs=1e-9)
    back = (velocities - previous)[roller] * np.sign(change[roller])
    if back > REVERSAL * (1.0 + 1e-6):
        assert not can_avoid_reversals(command, previous, step, ROWS, velocities)


@pytest.mark.parametrize('joint', [None, 'Z'])
def test_rollers_reach_a_twist_its_reverse_and_rest_within_the_acceleration(joint):
    robot = driven('north/R', joint=joint)
    for twist in (heading(30.0), heading(210.0), np.zeros(3)):
        statuses = []
        for _ in range(30):
            command = robot.step(twist)
            assert robot.change <= CHANGE * (1.0 + 1e-6)
            statuses.append(command.status)
        final = Status.OK if twist.any() else Status.IDLE
        reached = statuses.index(final)
        assert 0 < reached < 29
        assert statuses == [Status.ACCELERATING] * reached + [final] * (30 - reached)
    assert not command.roller_velocities.any()


@pytest.mark.parametrize(('elapsed', 'counted'), [(0.3, 1.0), (1.0, 1.0), (3.0, 3.0)])
def test_commands_of_rollers_change_by_the_elapsed_time_or_a_period_or_halt(elapsed, counted):
    servo, asked = driven('north/R').servo, np.linspace(-1.0, 1.0, N)
    first = servo.command(asked, 1.0)
    assert np.abs(first).max() == pytest.approx(CHANGE)
    second = servo.command(asked, 1.0 + elapsed * PERIOD)
    assert np.abs(second - first).max() == pytest.approx(counted * CHANGE)
    assert not servo.command(0.0 * asked, 1.0 + 4.0 * PERIOD).any()


def test_a_robot_of_little_acceleration_stops_before_its_limits():
    near = ROBOT.home.member_lengths.max() + 0.008
    slow = Robot(replace(ROBOT.description, max_acceleration=0.05, max_length=near))
    robot, file = driven('north/R', slow), slow.description
    for _ in range(50):
        robot.step(heading(30.0), 4.0 * PERIOD)
        assert robot.change <= 0.05 * 4.0 * PERIOD * (1.0 + 1e-6)
        lengths = robot.held.config.member_lengths
        assert file.min_length <= lengths.min()
        assert lengths.max() <= file.max_length
    assert lengths.max() > file.max_length - 4e-3


def test_a_violated_limit_changes_the_speeds_by_the_least():
    """The point of a half space next to another one is on the normal of its bound."""
    rng = np.random.default_rng(0)
    wanted = solve_twist(ROBOT.home, GRIP, heading(30.0))
    contacts = grip_jacobian(ROBOT.home, GRIP)[3:]
    normal = rng.standard_normal(N)
    normal -= np.linalg.pinv(contacts) @ contacts @ normal
    previous = wanted.roller_velocities + 2.0 * CHANGE * normal / np.abs(normal).max()
    bound = normal @ wanted.roller_velocities
    rows = Rows(normal[None], np.array([-np.inf]), np.array([bound]))
    command = limit_acceleration(wanted, previous, np.zeros(N), CHANGE, lambda: rows)
    middle = 0.5 * (previous + wanted.roller_velocities)
    assert command.roller_velocities == pytest.approx(middle, abs=1e-9)


def test_failed_rollers_stand_still_while_others_avoid_reversals():
    roller = ROBOT.roller_names[5]
    command = solve_twist(ROBOT.home, GRIP, 0.2 * heading(30.0), [roller])
    speeds, step = command.roller_velocities, np.zeros(N)
    step[0] = -np.sign(speeds[0]) * CHANGE
    previous = speeds - 0.5 * CHANGE * np.sign(speeds)
    previous[5] = 0.0
    changed = limit_acceleration(command, previous, step, CHANGE, lambda: ROWS)
    assert changed.roller_velocities[5] == 0.0
    assert (changed.roller_velocities != speeds).any()
    assert changed.achieved_twist == pytest.approx(command.achieved_twist, abs=1e-12)
