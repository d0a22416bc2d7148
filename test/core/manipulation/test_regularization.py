# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How progress is traded against roller speed where limits bind: in closed form."""

from grips import disc_grip
from isotruss_ros.core import load_robot, solve_twist
from isotruss_ros.core.manipulation.limit_handling import LimitHandling
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


def solved(twist, regularized, slide=False):
    """Return the roller velocities of a twist with limited roller speeds."""
    return solve_twist(
        ROBOT.home,
        GRASP,
        twist,
        limits=[RollerSpeedLimit(MAX_SPEED)],
        handling=LimitHandling(slide, regularized),
    ).roller_velocities


@pytest.mark.parametrize('slide', [False, True])
@pytest.mark.parametrize('twist', [(1.0, 0.0, 0.0), (0.3, 1.0, 0.0), (0.0, 0.0, 5.0)])
def test_loops_scale_a_twist_to_the_limits_where_no_roller_is_redundant(twist, slide):
    assert solved(twist, True, slide) == pytest.approx(solved(twist, False, slide), rel=1e-6)


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
