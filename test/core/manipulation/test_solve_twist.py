# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Twist to rollers: equations of the paper, solvers of SciPy, limits and sliding along them."""

from dataclasses import replace
from functools import partial

from grips import disc_grip, surface
from hypothesis import assume, given
from hypothesis import strategies as st
from isotruss_ros.core import load_robot, Robot, solve_twist, solve_twist_ahead, Status
from isotruss_ros.core.errors import IsotrussError
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
from scipy.optimize import LinearConstraint, linprog, minimize
from walls import Wall

NUMBERS = st.integers(0, 10**6)
UNLIMITED = ()
NINE, TRIANGLE = load_robot('nine_member'), load_robot('triangle')
HOME = NINE.home
GRIP, SMALL = disc_grip(HOME, 'east/Q', 0.3), disc_grip(TRIANGLE.home, 'main/T', 0.2)


def well_posed(jacobian):
    """Return whether a task is far from singular."""
    gains = np.linalg.svd(jacobian, compute_uv=False)
    return len(gains) == 4 and gains[-1] > 1e-2


def paper_rows(config, grip, ends):
    """Return the twist (3, r) of a disc at a module, and the rate of the members' angle (r,)."""
    robot = config.robot
    velocities = config.node_jacobian.T.copy().view(complex)
    b, b_next, c, c_prev = (velocities[:, (config.points == end).argmax()] for end in ends)
    ahead, back = ends[1] - ends[0], ends[3] - ends[2]
    # (16), the rate of the direction angle of B -> B'; and of C -> C'.
    turning, turning_back = ((b_next - b) / ahead).imag, ((c_prev - c) / back).imag
    # (15): the object is at rest in the frame of B -> B'.
    center = b + 1j * turning * (grip.center - ends[0])
    # (17): the object rolls with the tube at the grip's module, unless that is passive.
    module = grip.members[0].split('-')[0]
    side = np.sign((ahead.conjugate() * (grip.center - ends[0])).imag)
    rolling = np.array([side / grip.body.arm * (n == module) for n in robot.roller_names])
    # (14), its derivative, counted from the member ahead to the one behind through the corner.
    return np.array([center.real, center.imag, turning + rolling]), side * (turning_back - turning)


def largest_scale(config, jacobian, twist):
    """Return the largest share of the twist within the limits, by HiGHS."""
    matrix, bound = stack_rows(config, default_limits(config.robot)).one_sided()
    goal = np.append(twist, 0.0)
    # In units of the quickest roller and of the unlimited solution, so that all is near 1.
    unit = config.robot.description.max_speed
    gain = np.abs(np.linalg.lstsq(jacobian, goal, rcond=None)[0]).max()
    count = jacobian.shape[1]
    solution = linprog(
        np.append(np.zeros(count), -1.0),
        np.column_stack([matrix, np.zeros(len(bound))]),
        bound / unit,
        np.column_stack([jacobian, -goal / gain]),
        np.zeros(4),
        [(None, None)] * count + [(0.0, None)],
        method='highs',
        options={'primal_feasibility_tolerance': 1e-10, 'dual_feasibility_tolerance': 1e-10},
    )
    assert solution.status == 0
    return min(1.0, solution.x[-1] * unit / gain)


@robots.examples(60)
@given(robots.robots(), robots.generators(), NUMBERS, st.booleans())
def test_rollers_are_those_of_the_paper(robot, rng, number, has_cost):
    """The least of (11) with (20), of which the rows are (14) to (18), as one linear system."""
    config, grasp, ends = robots.random_grasp(robot, rng, number)
    assume(well_posed(grip_jacobian(config, grasp)))
    twist = rng.standard_normal(3)
    rows, root = np.vstack(paper_rows(config, grasp, ends)), robot.topology.incidence
    cost = root.T @ root
    if has_cost:
        root = rng.standard_normal(cost.shape)
        cost = root.T @ root + 0.1 * np.eye(len(root))
    given_cost = 10.0 ** rng.uniform(-6.0, 6.0) * cost if has_cost else None
    command = solve_twist(config, grasp, twist, limits=UNLIMITED, cost=given_cost)
    system = np.block([[cost, rows.T], [rows, np.zeros((4, 4))]])
    right = np.concatenate([np.zeros(rows.shape[1]), twist, [0.0]])
    rollers = np.linalg.solve(system, right)[:-4]
    size = np.abs(rollers).max()
    assert command.status is Status.OK
    assert command.scale == 1.0
    assert command.limiting == ()
    assert command.achieved_twist == pytest.approx(twist, abs=1e-9 * size)
    assert command.roller_velocities == pytest.approx(rollers, abs=1e-8 * size)


@robots.examples(40)
@given(robots.robots(), robots.generators(), NUMBERS, st.floats(-3.0, 4.0))
def test_scale_is_maximal_and_its_cost_minimal(robot, rng, number, decades):
    config, grasp, _ = robots.random_grasp(robot, rng, number)
    jacobian = grip_jacobian(config, grasp)
    assume(well_posed(jacobian))
    twist = 10.0**decades * rng.standard_normal(3)
    command = solve_twist(config, grasp, twist)
    speeds, unit = command.roller_velocities, robot.description.max_speed
    # Direction kept, grip closed, limits obeyed.
    goal = np.append(command.scale * twist, 0.0)
    assert jacobian @ speeds == pytest.approx(goal, abs=1e-8 * np.abs(goal).max())
    matrix, bound = stack_rows(config, default_limits(config.robot)).one_sided()
    assert (matrix @ speeds <= bound + 1e-9).all()
    # The program gives up a millionth of the scale where that saves much motion of the members.
    assert command.scale == pytest.approx(largest_scale(config, jacobian, twist), rel=1e-5)
    assert (command.scale == 1.0) == (command.status is Status.OK)
    assert (command.scale == 1.0) == (command.limiting == ())
    cost = robot.topology.incidence.T @ robot.topology.incidence / unit**2
    solution = minimize(
        lambda u: u @ cost @ u,
        speeds + 0.1 * unit * rng.standard_normal(len(speeds)) * (command.scale < 1.0),
        jac=lambda u: 2.0 * cost @ u,
        constraints=[
            LinearConstraint(jacobian / unit, goal / unit, goal / unit),
            LinearConstraint(matrix / unit, -np.inf, bound / unit),
        ],
        method='SLSQP',
        options={'ftol': 1e-14, 'maxiter': 300},
    )
    if solution.success and np.abs(jacobian @ solution.x - goal).max() < 1e-9 * unit:
        assert speeds @ cost @ speeds <= solution.fun * (1.0 + 1e-5) + 1e-12


def test_a_zero_twist_and_no_working_rollers_move_nothing():
    idle = solve_twist(HOME, GRIP, [0.0, -0.0, 0.0])
    stuck = solve_twist(HOME, GRIP, [0.01, 0.0, 0.0], failed=NINE.roller_names)
    assert (idle.status, idle.scale, stuck.status) == (Status.IDLE, 1.0, Status.UNREACHABLE)
    for command in (idle, stuck):
        assert command.roller_velocities.tolist() == [0.0] * 6
        assert command.achieved_twist.tolist() == [0.0] * 3
    # The name of one failed roller may stand alone.
    alone, listed = (
        solve_twist(HOME, GRIP, [0.0, 0.01, 0.0], failed=failed)
        for failed in ('south/Q', ['south/Q'])
    )
    assert alone.roller_velocities.tolist() == listed.roller_velocities.tolist()


def test_member_at_its_limit_is_named():
    robot, twist = NINE, [0.0, 0.01, 0.0]
    free = solve_twist(HOME, GRIP, twist)
    growing = robot.topology.incidence @ free.roller_velocities
    longest = float(HOME.member_lengths.max())
    # No member may grow; those that would are named, whichever way round the twist is.
    limit = MemberLengthLimit(0.25, longest)
    for sign in (1.0, -1.0):
        command = solve_twist(HOME, GRIP, sign * np.array(twist), limits=[limit])
        assert command.status is Status.SLOWED_MEMBER_LENGTH
        assert command.limiting
        wanted = {
            name
            for name, rate in zip(robot.member_names, growing, strict=True)
            if sign * rate > 0.0
        }
        assert set(command.limiting) <= wanted
        assert (robot.topology.incidence @ command.roller_velocities).max() < 1e-9


def test_limits_scale_the_opening_with_the_twist():
    grasp = disc_grip(HOME, 'north/Z', 0.3)
    free = solve_twist(HOME, grasp, (0.01, 0.0, 0.0), opening_rate=-0.004)
    slowed = solve_twist(HOME, grasp, (1.0, 0.0, 0.0), opening_rate=-0.4)
    assert free.scale == 1.0
    assert 0.0 < slowed.scale < 1.0
    share = slowed.scale / 0.01
    assert slowed.roller_velocities == pytest.approx(share * free.roller_velocities, rel=1e-5)


def test_the_grip_opens_while_the_object_slides_along_limits():
    config = HOME
    grasp = disc_grip(config, 'north/Z', 0.3)
    length = config.member_lengths.min()
    limits = [RollerSpeedLimit(0.5), MemberLengthLimit(length - 2e-3, length + 2e-3)]
    slid, loop = 0, LimitHandling(slide_along_limits=True, regularized=True)
    for heading in np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False):
        twist = 0.05 * np.array([np.cos(heading), np.sin(heading), 0.0])
        command = solve_twist(config, grasp, twist, (), limits, loop, opening_rate=0.004)
        opened = grip_jacobian(config, grasp)[3] @ command.roller_velocities
        assert opened == pytest.approx(0.004, rel=1e-6)
        slid += command.status is Status.SLIDING
    assert slid > 3


def test_an_opening_rate_that_limits_exclude_is_zero():
    jacobian = grip_jacobian(HOME, GRIP)
    closed = Wall(-jacobian[3:], np.array([1e-3]))
    limits = [RollerSpeedLimit(0.5), closed]
    slide = LimitHandling(slide_along_limits=True)
    for rate, opened in ((0.0009, 0.0009), (0.004, 0.0)):
        command = solve_twist(HOME, GRIP, (0.01, 0.0, 0.0), (), limits, slide, opening_rate=rate)
        assert jacobian[3] @ command.roller_velocities == pytest.approx(opened, abs=1e-9)


TWIST = 'the twist \\(vx, vy .* must be 3 finite numbers'
ROLLERS = 'no such rollers; .*its rollers are main/R, main/T'
#: Words of refusals and calls; main/L is a module without a motor that could fail.
REFUSED = [
    (TWIST, lambda: solve_twist(TRIANGLE.home, SMALL, [np.nan, 0.0, 0.0])),
    (TWIST, lambda: solve_twist(TRIANGLE.home, SMALL, [0.0, 0.0])),
    *(
        (ROLLERS, partial(solve_twist, TRIANGLE.home, SMALL, np.zeros(3), failed))
        for failed in ({'main/W'}, ['main/L'], 'T', [None])
    ),
    *(
        (words, partial(solve_twist, HOME, GRIP, (0.01, 0.0, 0.0), cost=cost))
        for words, cost in {
            'must be 6': np.eye(6)[:5],
            'must be 6 x 6 finite numbers': np.full((6, 6), np.nan),
            'add a small multiple of the identity': np.diag([1.0, 1, 1, 1, 1, 0]),
            'must be symmetric': 6.0 * np.eye(6) + np.eye(6, k=1),
        }.items()
    ),
    *(
        (words, partial(solve_twist_ahead, HOME, GRIP, [0.0, 0.05, 0.0], lead))
        for words, lead in (('lead .* from 0', -1e-3), ('lead .*', np.inf), ('nine_member', 1e3))
    ),
]


@pytest.mark.parametrize(('words', 'call'), REFUSED)
def test_invalid_arguments_are_refused_with_the_valid_ones(words, call):
    with pytest.raises(IsotrussError, match=words):
        call()


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
    assert task.status is (Status.SLIDING if soft_rank > 0.3 else Status.OK)
    executed = jacobian[:3] @ task.velocities @ twist / (twist @ twist)
    assert task.share == (pytest.approx(executed) if soft_rank > 0.3 else 1.0)


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
