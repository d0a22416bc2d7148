# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A limit of one's own: a supply that no two rollers together exceed."""

from dataclasses import replace
import itertools

from driven import Driven
from grips import disc_grip
from isotruss_ros.core import load_robot, Robot, RollingGrip, solve_twist, Status
from isotruss_ros.core.manipulation.limit_handling import LimitHandling
from isotruss_ros.core.manipulation.limits import default_limits, Rows
import numpy as np
import pytest

ROBOT = load_robot('nine_member')
GRIP = disc_grip(ROBOT.home, 'north/Z')
TWIST = np.array([0.02, 0.0, 0.0])
SPEED = 0.002


class SupplyLimit:
    """Bound on the speed of any two rollers together [m/s]."""

    status = Status.SLOWED_BARRIER
    can_slide = False

    def __init__(self, speed):
        self.speed = speed

    def rows(self, config):
        """Return the sum and the difference of the speeds of each pair."""
        unit = np.eye(len(config.robot.roller_names))
        pairs = list(itertools.combinations(unit, 2))
        matrix = np.array([one + sign * other for one, other in pairs for sign in (1.0, -1.0)])
        bound = np.full(len(matrix), self.speed)
        return Rows(matrix, -bound, bound)

    def row_names(self, config):
        """Return what the rows are."""
        return ('the supply',) * len(self.rows(config).upper)


def fastest_two(velocities):
    """Return the speed of the two fastest rollers together [m/s]."""
    return np.sort(np.abs(velocities))[-2:].sum()


@pytest.mark.parametrize('slide', [False, True])
def test_a_scaled_twist_names_the_limit(slide):
    limits = (*default_limits(ROBOT), SupplyLimit(SPEED))
    handling = LimitHandling(slide_along_limits=slide)
    command = solve_twist(ROBOT.home, GRIP, TWIST, limits=limits, handling=handling)
    assert command.status is Status.SLOWED_BARRIER
    assert set(command.limiting) == {'the supply'}
    assert fastest_two(command.roller_velocities) == pytest.approx(SPEED, rel=1e-6)
    assert command.achieved_twist == pytest.approx(command.scale * TWIST, abs=1e-9)


def test_a_loop_keeps_the_limit():
    robot = Robot(replace(ROBOT.description, max_acceleration=np.inf))
    driven = Driven(RollingGrip.attach(robot.home, GRIP), limits=(SupplyLimit(SPEED),))
    command = driven.step(TWIST)
    assert command.status is Status.SLOWED_BARRIER
    assert fastest_two(command.roller_velocities) <= SPEED * (1.0 + 1e-6)
    assert set(command.limiting) == {'the supply'}
