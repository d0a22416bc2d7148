# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Limits of member lengths, and scaling and sliding at limits with nearly singular directions."""

from dataclasses import replace

from grips import disc_grip, surface
from hypothesis import assume, given
from hypothesis import strategies as st
from isotruss_ros.core import load_robot, Robot, solve_twist, Status
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.manipulation.limit_handling import LimitHandling
from isotruss_ros.core.manipulation.limits import (
    default_limits,
    MemberLengthLimit,
    RollerSpeedLimit,
    stack_rows,
)
from isotruss_ros.core.manipulation.task import find_task, Reach, WorkingRollers
from isotruss_ros.core.numerics.tolerances import NEGLIGIBLE_SHARE
import numpy as np
import pytest
import robots
from scipy.optimize import linprog
from walls import Wall

HOME = load_robot('nine_member').home
SLIDE = LimitHandling(slide_along_limits=True)


def furthest_along(normal, rows, kept):
    """Return the largest normal . u of all admissible u."""
    matrix, lower, upper = rows
    bounded = np.isfinite(upper)
    solution = linprog(
        -normal,
        np.vstack([matrix[bounded], -matrix]),
        np.concatenate([upper[bounded], -lower]),
        kept,
        np.zeros(len(kept)),
        [(None, None)] * len(normal),
        method='highs',
    )
    assert solution.status == 0
    return -solution.fun


@robots.examples(40)
@given(robots.robots(('arch', 'ring')), robots.generators(), st.integers(0, 10**6))
def test_sliding_projects_the_twist_on_the_admissible_ones(robot, rng, number):
    config, grasp, _ = robots.random_grasp(robot, rng, number)
    jacobian = grip_jacobian(config, grasp)
    r = len(robot.roller_names)
    wall = Wall(rng.standard_normal((3, r)), rng.choice([0.0, 0.01, 0.1], 3))
    # Rollers are quick enough: only the walls are in the way. A robot that is nearly singular
    # needs quicker ones, and slides along the walls with what its rollers leave of the twist.
    speed = RollerSpeedLimit(10.0)
    limits = [speed, wall]
    twist = 0.1 * rng.standard_normal(3)
    free = solve_twist(config, grasp, twist, (), [speed])
    assume(free.scale == 1.0)
    command = solve_twist(config, grasp, twist, (), limits, handling=SLIDE)
    scaled = solve_twist(config, grasp, twist, (), limits)
    if command.scale == 1.0:
        assert command.roller_velocities == pytest.approx(scaled.roller_velocities)
        return
    assume(scaled.status is not Status.UNREACHABLE)
    assume(np.abs(command.roller_velocities).max() < 9.9)
    assert command.status is Status.SLIDING
    # Where other speeds than the least carry out the twist too, rolling alone can be in the way.
    if scaled.scale < 1.0:
        assert set(command.limiting) & set(wall.row_names(config))
    measure = surface(grasp)
    wanted, got = measure * twist, measure * command.achieved_twist
    # The variational inequality: no admissible motion lies further toward what is missing, less
    # the little that deviation from the free speeds costs.
    missing = wanted - got
    incidence = robot.topology.incidence
    off = [c.roller_velocities - free.roller_velocities for c in (command, scaled)]
    slid, stood = (incidence @ way for way in off)
    downhill = missing @ (measure[:, None] * jacobian[:3])
    downhill -= NEGLIGIBLE_SHARE * incidence.T @ slid
    most = furthest_along(downhill, stack_rows(config, limits), jacobian[3:])
    assert most == pytest.approx(downhill @ command.roller_velocities, abs=1e-5)
    assert (wall.matrix @ command.roller_velocities >= -wall.bound - 1e-7).all()
    # What is minimised is no more than for scaling, deviation included: near a singular robot,
    # where small twists take fast rollers, it costs more than a hundredth of the twist.
    rolling = NEGLIGIBLE_SHARE * np.square(slid).sum()
    allowance = NEGLIGIBLE_SHARE * np.square(stood).sum()
    along = wanted / np.linalg.norm(wanted)
    stopped = measure * scaled.achieved_twist
    assert missing @ missing + rolling <= np.square(wanted - stopped).sum() + allowance + 1e-9
    # As far along the twist as scaling, less what deviation can cost.
    assert along @ got >= along @ stopped - np.sqrt(allowance + 1e-9)
    assert command.scale == pytest.approx(along @ got / np.linalg.norm(wanted), abs=1e-6)


@robots.examples(30)
@given(robots.robots(), robots.generators(), st.integers(0, 10**6))
def test_regularization_keeps_the_direction_and_nearly_the_progress(robot, rng, number):
    config, grasp, _ = robots.random_grasp(robot, rng, number)
    twist = 10.0 ** rng.uniform(-2.0, 1.0) * rng.standard_normal(3)
    exact = solve_twist(config, grasp, twist)
    thrifty = solve_twist(config, grasp, twist, handling=LimitHandling(regularized=True))
    assert thrifty.scale <= exact.scale + 1e-6
    assert np.abs(thrifty.roller_velocities).max() <= robot.description.max_speed + 1e-9
    free = solve_twist(config, grasp, twist, limits=())
    if (free.roller_velocities == exact.roller_velocities).all():
        assert (thrifty.roller_velocities == free.roller_velocities).all()
        return
    if exact.status is not Status.UNREACHABLE:
        assert thrifty.achieved_twist == pytest.approx(thrifty.scale * twist, abs=1e-8)
    # Where the rollers move the object well, little progress is lost.
    surface_speed = np.linalg.norm(surface(grasp) * exact.achieved_twist)
    if surface_speed > 0.3 * np.linalg.norm(exact.roller_velocities):
        assert thrifty.scale > 0.9 * exact.scale


def test_regularization_gives_up_progress_that_takes_much_motion():
    shares = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        config, grasp, _ = robots.random_grasp(HOME.robot, rng, seed)
        exact, thrifty = (
            solve_twist(config, grasp, (1.0, 2.0, 3.0), handling=LimitHandling(regularized=way))
            for way in (False, True)
        )
        shares.append(thrifty.scale / exact.scale)
    assert min(shares) < 0.97


@pytest.mark.parametrize('slide', [False, True])
def test_commands_are_continuous_where_a_limit_begins_to_bind(slide):
    grip, twist = disc_grip(HOME, 'east/Q'), (0.1, 0.0, 0.0)
    free = solve_twist(HOME, grip, twist, limits=[]).roller_velocities
    for roller, speed in enumerate(free):
        wall = Wall(-np.sign(speed) * np.eye(len(free))[[roller]], (1.0 - 1e-6) * np.abs([speed]))
        handling = LimitHandling(slide, True)
        command = solve_twist(HOME, grip, twist, limits=[wall], handling=handling)
        assert command.roller_velocities == pytest.approx(free, abs=1e-4 * np.abs(free).max())


@pytest.mark.parametrize('opening', [0.0, 0.3])
@pytest.mark.parametrize('soft_rank', [0.1, 0.205, 0.4])
def test_nearly_singular_directions_are_reduced_by_the_squared_singular_value(soft_rank, opening):
    basis, modes = (np.linalg.qr(np.random.default_rng(n).normal(size=(n, n)))[0] for n in (6, 3))
    gains = np.array([1.0, 0.5, 0.2])
    # The contact row also moves the object, which the opening rate has to compensate.
    coupling = np.array([0.3, -0.2, 0.1])
    jacobian = np.vstack([(modes * gains) @ basis[:3] + np.outer(coupling, basis[3]), basis[3]])
    reach = Reach.of(jacobian.copy(), WorkingRollers(6, np.arange(6), np.eye(6)), np.ones(3))
    twist = np.array([0.4, -0.7, 0.5])
    task = find_task(reach, twist, opening, soft_rank)
    shares = np.minimum(1.0, (gains / soft_rank) ** 2)
    expected = modes @ (shares * (modes.T @ (twist - opening * coupling))) + opening * coupling
    assert jacobian @ task.velocities == pytest.approx([*expected, opening])
    # 0.205 removes less than 5 % of the twist.
    assert task.status is (Status.UNREACHABLE if soft_rank > 0.3 else Status.OK)


@robots.examples(15)
@given(robots.robots(), robots.generators())
def test_members_approach_their_bounds_exponentially(robot, rng):
    """A member at the bounding speed reaches the bound after 1/rate; beyond it may only return."""
    config = robots.random_state(robot, rng)
    lengths = config.member_lengths
    rows = MemberLengthLimit(0.5, 1.0, rate=4.0).rows(config)
    assert lengths + rows.upper / 4.0 == pytest.approx(np.maximum(lengths, 1.0))
    assert lengths + rows.lower / 4.0 == pytest.approx(np.minimum(lengths, 0.5))
    rates = rng.standard_normal(len(robot.roller_names))
    moved = config.moved_to(config.roller_positions + 1e-6 * rates)
    assert 1e-6 * rows.matrix @ rates == pytest.approx(moved.member_lengths - lengths, abs=1e-11)


def test_members_approach_their_bounds_no_faster_than_the_rollers_brake():
    limits = {'min_length': 0.9, 'max_length': 1.1, 'max_acceleration': 0.2}
    robot = Robot(replace(HOME.robot.description, **limits))
    upper = stack_rows(robot.home, default_limits(robot)).upper
    bounds = upper[len(robot.roller_names) :]  # noqa: E203
    braking_rate = 0.2 / robot.description.max_speed
    assert bounds == pytest.approx(braking_rate * (1.1 - robot.home.member_lengths))
