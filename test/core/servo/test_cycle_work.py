# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bound on the work of a control cycle."""

import math

from isotruss_ros import core
from isotruss_ros.core.contact.dents import dent_table
from isotruss_ros.core.inputs import RollerState, StampedInput
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.numerics.work_limit import count_work, limited_work, WorkLimitError
from isotruss_ros.core.servo.servo_settings import ServoSettings, SqueezeSettings
from isotruss_ros.core.servo.servo_step import MAX_CYCLE_WORK
import numpy as np
import pytest

ROBOT = core.load_robot('nine_member')
ANGLES = np.arange(6) * math.pi / 3
#: Hexagon with a face almost along a member: the search for its contacts needs many dents.
HEXAGON = core.Polygon(0.15 * np.column_stack([np.cos(ANGLES), np.sin(ANGLES)]), 0.02)
GRIP = core.place_between(ROBOT.home, members_at(ROBOT, 'north/Z'), HEXAGON, 0.1, 0.02)


class Loop:
    """A servo whose rollers and object follow its commands, and the work of its cycles."""

    def __init__(self):
        settings = ServoSettings(GRIP, 0.01, 0.2, squeeze=SqueezeSettings(20.0))
        self.servo, self.now = core.TwistServo(ROBOT, settings), 1.0
        self.travel, self.pose, self.work = ROBOT.home.roller_positions, GRIP.body.pose, []

    def cycle(self, pressures=None):
        """Return the decision of the next cycle."""
        self.now += 0.01
        self.servo.receive(
            twist=StampedInput((0.03, 0.02, 0.1), self.now),
            rollers=StampedInput(RollerState(self.travel, np.zeros(6)), self.now),
            pose=StampedInput(self.pose, self.now),
            pressures=None if pressures is None else StampedInput(pressures, self.now),
        )
        with limited_work(10**6) as work:
            decision = self.servo.decide(self.now)
        self.work.append(work.done)
        self.travel = self.travel + 0.01 * decision.command.roller_velocities
        self.pose = core.Pose(*np.add(self.pose, 0.01 * decision.command.achieved_twist))
        return decision

    @property
    def belief(self):
        """Return the belief of the grip."""
        return self.servo.squeeze.belief


def test_new_dents_delay_the_start_of_a_grip_and_do_not_change_it():
    dent_table.cache_clear()
    loop = Loop()
    assert 'goes on in the next cycle' in loop.cycle().message
    while loop.belief is None:
        loop.cycle()
    assert max(loop.work) == MAX_CYCLE_WORK
    known = Loop()
    known.cycle()
    assert known.belief.squeeze == pytest.approx(loop.belief.squeeze)


def test_other_pressures_of_a_moving_grip_stay_within_the_work_of_a_cycle():
    loop = Loop()
    while loop.belief is None:
        loop.cycle()
    pressures = np.array(loop.belief.held.pressures)
    for factor in (1.05, 1.1, 1.15):
        for _ in range(10):
            assert loop.cycle(tuple(factor * pressures)).command.roller_velocities.any()
        assert loop.belief.held.pressures == pytest.approx(factor * pressures)
    assert max(loop.work) <= MAX_CYCLE_WORK


def test_a_search_after_a_lost_balance_stays_within_the_work_of_a_cycle():
    loop = Loop()
    while loop.belief is None:
        loop.cycle()
    loop.travel = loop.travel + 0.04 * np.cos(np.arange(6))
    dent_table.cache_clear()
    for _ in range(20):
        loop.cycle()
    assert MAX_CYCLE_WORK // 4 < max(loop.work[-20:]) <= MAX_CYCLE_WORK


def test_an_enclosing_bound_counts_and_limits_inner_work():
    with limited_work(3) as outer:
        with limited_work(2):
            count_work()
            count_work(is_stored=True)
            with pytest.raises(WorkLimitError, match='2 units of work') as reached:
                count_work()
        assert reached.value.advances
        count_work()
        with limited_work(2), pytest.raises(WorkLimitError) as reached:
            count_work()
        assert not reached.value.advances
    assert outer.done == 3
    count_work()  # without a bound
