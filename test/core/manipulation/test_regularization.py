# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How progress is traded against roller speed where limits bind: in closed form."""

from grips import disc_grip
from isotruss_ros.core import load_robot, solve_twist
from isotruss_ros.core.manipulation import limit_handling
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.manipulation.limit_handling import LimitHandling
from isotruss_ros.core.manipulation.limits import RollerSpeedLimit
import numpy as np
import pytest
import scipy
from walls import Wall

ROBOT, NINE = load_robot('triangle'), load_robot('nine_member')
MODULE = ROBOT.module_names[1]
MAX_SPEED = ROBOT.description.max_speed
GRASP = disc_grip(ROBOT.home, MODULE, 0.3)


def stop(count, roller, velocity):
    """Return what keeps one of so many rollers from moving faster, in one direction."""
    row = np.zeros((1, count))
    row[0, roller] = -np.sign(velocity)
    return Wall(row, np.array([abs(velocity)]))


def solved(twist, regularized, slide=False):
    """Return the roller velocities of a twist with limited roller speeds."""
    return solve_twist(
        ROBOT.home,
        GRASP,
        twist,
        limits=[RollerSpeedLimit(MAX_SPEED)],
        handling=LimitHandling(slide, regularized),
    ).roller_velocities


@pytest.mark.parametrize('share', [0.1, 0.5, 0.9])
@pytest.mark.parametrize('twist', [(0.05, 0.0, 0.0), (0.02, 0.04, 0.0), (0.0, 0.0, 0.2)])
def test_progress_costs_deviation_from_the_free_speeds_as_in_closed_form(
    twist, share, monkeypatch
):
    """With n = u - s f at one stop g u <= b: |C n|^2 / 2 = (s g f - b)^2 / 2 k."""
    grip = disc_grip(NINE.home, 'east/Q', 0.3)
    free = solve_twist(NINE.home, grip, twist, limits=[]).roller_velocities
    asked = np.abs(free).max()
    f = free / asked
    gain = asked / np.linalg.norm(np.array(twist) * (1.0, 1.0, grip.body.arm))
    weight = 0.2  # so little that progress is given up
    monkeypatch.setattr(limit_handling, 'PROGRESS_WEIGHT', weight)
    rho = weight * NINE.description.max_speed / (asked * gain)
    null = scipy.linalg.null_space(grip_jacobian(NINE.home, grip))
    cost = NINE.topology.incidence.T @ NINE.topology.incidence
    compliance = null @ np.linalg.solve(null.T @ cost @ null, null.T)
    stopped = int(np.abs(f * compliance.diagonal()).argmax())
    a, b, k = abs(f[stopped]), share * abs(f[stopped]), compliance[stopped, stopped]
    progress = min(1.0, (rho + a * b / k) / (a * a / k + 0.5 * rho))
    found = solve_twist(
        NINE.home,
        grip,
        twist,
        limits=[stop(len(free), stopped, share * free[stopped])],
        handling=LimitHandling(regularized=True),
    )
    assert share < progress
    wanted = progress * f + (share - progress) * f[stopped] * compliance[stopped] / k
    assert found.roller_velocities == pytest.approx(asked * wanted, rel=1e-6)


@pytest.mark.parametrize('slide', [False, True])
@pytest.mark.parametrize('twist', [(1.0, 0.0, 0.0), (0.3, 1.0, 0.0), (0.0, 0.0, 5.0)])
def test_loops_scale_a_twist_to_the_limits_where_no_roller_is_redundant(twist, slide):
    assert solved(twist, True, slide) == pytest.approx(solved(twist, False, slide), rel=1e-6)


def test_rollers_have_their_largest_speed_without_regularisation():
    assert np.abs(solved((1.0, 0.0, 0.0), False)).max() == pytest.approx(MAX_SPEED)


def test_sliding_trades_the_twist_against_roller_speed_in_loops_only():
    robot, twist = NINE, (0.05, 0.0, 0.0)
    grasp = disc_grip(robot.home, 'east/Q', 0.3)
    free = solve_twist(robot.home, grasp, twist, limits=[]).roller_velocities
    quickest = int(np.abs(free).argmax())

    def slid(regularized, share):
        return solve_twist(
            robot.home,
            grasp,
            twist,
            limits=[stop(len(free), quickest, share * free[quickest])],
            handling=LimitHandling(True, regularized),
        ).roller_velocities

    assert np.linalg.norm(slid(True, 0.3)) < (1.0 - 1e-4) * np.linalg.norm(slid(False, 0.3))
    # Nothing is traded where the stop is on the other side.
    assert slid(True, -0.3) == pytest.approx(free)


@pytest.mark.parametrize('slide', [False, True])
@pytest.mark.parametrize('speed', [0.05, 0.2])
def test_the_command_does_not_jump_where_a_limit_begins_to_bind(slide, speed):
    grip = disc_grip(NINE.home, 'east/Q', 0.3)
    free = solve_twist(NINE.home, grip, (speed, 0.0, 0.0), limits=[]).roller_velocities
    for roller in range(len(free)):
        command = solve_twist(
            NINE.home,
            grip,
            (speed, 0.0, 0.0),
            limits=[stop(len(free), roller, (1.0 - 1e-6) * free[roller])],
            handling=LimitHandling(slide, True),
        )
        assert command.roller_velocities == pytest.approx(free, abs=1e-4 * np.abs(free).max())
