# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Twist to rollers: against equations of the paper and solvers of SciPy."""

from functools import partial

from grips import disc_grip
from hypothesis import assume, given
from hypothesis import strategies as st
from isotruss_ros.core import load_robot, solve_twist, solve_twist_ahead, Status
from isotruss_ros.core.errors import IsotrussError
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.manipulation.limit_handling import LimitHandling
from isotruss_ros.core.manipulation.limits import (
    default_limits,
    MemberLengthLimit,
    RollerSpeedLimit,
    stack_rows,
)
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
