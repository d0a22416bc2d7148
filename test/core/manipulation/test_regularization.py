# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How progress is traded against roller speed where limits bind: in closed form."""

from grips import disc_grip
from isotruss_ros.core import load_robot, solve_twist
from isotruss_ros.core.manipulation.limit_handling import (
    LimitHandling,
    PROGRESS_WEIGHT,
    REFERENCE_PERIOD,
)
from isotruss_ros.core.manipulation.limits import RollerSpeedLimit
import numpy as np
import pytest
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


def solved(twist, period, slide=False, others=()):
    """Return the roller velocities of a twist with limited roller speeds."""
    return solve_twist(
        ROBOT.home,
        GRASP,
        twist,
        limits=[RollerSpeedLimit(MAX_SPEED), *others],
        handling=LimitHandling(slide, period),
    ).roller_velocities


@pytest.mark.parametrize('slide', [False, True])
@pytest.mark.parametrize('speed', [0.05, 1.0])
@pytest.mark.parametrize('twist', [(1.0, 0.0, 0.0), (0.3, 1.0, 0.0), (0.0, 0.0, 5.0)])
def test_progress_costs_roller_speed_as_in_closed_form(twist, speed, slide):
    """With p of the task of a largest roller speed 1: c p^2 / 2 - rho p + rho p^2 / (4 reach)."""
    command = solve_twist(ROBOT.home, GRASP, speed * np.array(twist), limits=[])
    free, wanted = command.roller_velocities, command.achieved_twist
    surface = np.linalg.norm(wanted * (1.0, 1.0, GRASP.body.arm))
    asked = np.abs(free).max()
    gain = asked / surface
    unit = min(MAX_SPEED, asked)
    # So small that neither the speeds nor the stop bind; the stop does for the free solution.
    rho = 0.2
    weight = rho * unit * gain / MAX_SPEED
    # Beyond the reference the weight falls with the period.
    period = REFERENCE_PERIOD * PROGRESS_WEIGHT / weight
    assert period > REFERENCE_PERIOD
    cost = np.sum((ROBOT.topology.incidence @ free / asked) ** 2)
    progress = rho / (cost + 0.5 * rho * unit / asked)
    found = solved(wanted, period, slide, [stop(len(free), 0, 0.9 * free[0])])
    assert found == pytest.approx(progress * unit * free / asked, rel=1e-9, abs=1e-12)


def test_the_weight_of_progress_is_the_same_below_the_reference_period():
    twist = (1.0, 0.0, 0.0)
    quick, reference = (solved(twist, share * REFERENCE_PERIOD) for share in (0.1, 1.0))
    assert quick == pytest.approx(reference)
    # Without a period there is no such trade: rollers have their largest speed.
    assert np.abs(solved(twist, 0.0)).max() == pytest.approx(MAX_SPEED)


def test_sliding_trades_the_twist_against_roller_speed_in_loops_only():
    robot, twist = NINE, (0.05, 0.0, 0.0)
    grasp = disc_grip(robot.home, 'east/Q', 0.3)
    free = solve_twist(robot.home, grasp, twist, limits=[]).roller_velocities
    quickest = int(np.abs(free).argmax())

    def slid(period, share):
        return solve_twist(
            robot.home,
            grasp,
            twist,
            limits=[stop(len(free), quickest, share * free[quickest])],
            handling=LimitHandling(True, period),
        ).roller_velocities

    assert np.linalg.norm(slid(1e-2, 0.3)) < (1.0 - 1e-4) * np.linalg.norm(slid(0.0, 0.3))
    # Nothing is traded where the stop is on the other side.
    assert slid(1e-2, -0.3) == pytest.approx(free)
