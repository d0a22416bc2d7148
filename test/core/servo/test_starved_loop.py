# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bound on the work of a cycle, and loops starved of processor time."""

from itertools import product
import math

from held_grips import HOME, numbers
from isotruss_ros import core
from isotruss_ros.core import Disc, Ellipse, Grip, place_between, Polygon, Pose, Status
from isotruss_ros.core.contact.dents import dent_table
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.inputs import RollerState, StampedInput
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.numerics.work_limit import limited_work
from isotruss_ros.core.servo.servo_settings import ServoSettings, SqueezeSettings
from isotruss_ros.core.servo.servo_step import MAX_CYCLE_WORK
from nightly import some_now
import numpy as np
import pytest
from squeeze_loop import SqueezeLoop

MEMBERS = ('north/Z-R', 'north/P-Z')
BOX = Polygon([(-0.08, -0.06), (0.08, -0.06), (0.08, 0.06), (-0.08, 0.06)], 0.02)
TRIANGLE = Polygon([(0.13, 0.0), (-0.065, 0.113), (-0.065, -0.113)], 0.02)
DISC, ELLIPSE = (Disc(0.3), 0.0, 0.02), (Ellipse((0.28, 0.22)), 1.0, 0.02)
FACE, CORNERS = (BOX, 0.5, 0.015), (BOX, 0.0, 0.015)
TURNED = TRIANGLE, 1.0 + math.pi / 2.0, 0.015
#: Time between two steps of the plant [s], and the period of the servo that it misses [s].
TICK = PERIOD = 0.01
RUNNING = {Status.OK, Status.IDLE, Status.ACCELERATING}


def rest(_):
    return 0.0, 0.0, 0.0


def sway(now):
    return 0.03 * math.sin(math.pi * now), 0.0, 0.0


def turn(now):
    return 0.0, 0.01, 0.1 * math.sin(2.0 * now)


def starve(held, twist, duration, mean, noise, seed=0):
    """
    Run a servo whose cycles, readings and commands are late at random; return it and its messages.

    :param held: shape, angle and indentation of the object.
    :param mean: mean time between two cycles, at least 20 ms and at most 0.2 s [s].
    """
    rng, (shape, angle, depth) = np.random.default_rng(seed), held
    grip = place_between(HOME, MEMBERS, shape, angle=angle, indentation=depth)
    body = attach_grip(HOME, grip.body, numbers(MEMBERS)).body
    defaults = {'pose_gain': None, 'load': 0.0, 'zero_deviation': 1e-3, 'servo': {'timeout': 0.5}}
    loop = SqueezeLoop(HOME, Grip(MEMBERS, body, 1.2), period=PERIOD, **defaults)
    plant, servo, sent, messages, due = loop.plant, loop.servo, [], set(), 0.0
    for number in range(round(duration / TICK)):
        now = TICK * number
        while sent and sent[0][0] <= now:
            plant.command(sent.pop(0)[1])
        if number == 0 or rng.random() < 0.3:
            state = RollerState(plant.roller_positions, plant.roller_velocities)
            pose = Pose(*plant.object_pose + noise * rng.standard_normal(3) * (1.0, 1.0, 6.0))
            servo.receive(rollers=StampedInput(state, now), pose=StampedInput(pose, now))
        if now >= due:
            due = now + min(0.02 + rng.exponential(mean - 0.02), 0.2)
            servo.receive(twist=StampedInput(twist(now), now))
            decision = servo.decide(now)
            assert decision.command.status in RUNNING, decision
            sent.append((now + rng.uniform(0.0, 0.15), decision.command.roller_velocities))
            messages.add(decision.message)
        plant.advance(TICK)
    assert loop.object.dropped is None, loop.object.dropped
    return servo, messages


MOTIONS = [(TURNED, turn), (FACE, rest), (DISC, sway), (ELLIPSE, sway), (CORNERS, turn)]
#: Duration [s], mean time between two cycles [s] and noise of the poses [m].
LATENESS = [*product((2.5,), (0.033, 0.1), (0.0, 1e-3))]


@pytest.mark.parametrize(
    ('held', 'twist', 'duration', 'mean', 'noise'),
    some_now(
        [
            (TURNED, turn, 0.5, 0.033, 0.0),
            *((*motion, *late) for motion, late in product(MOTIONS, LATENESS)),
        ]
    ),
)
def test_loop_starved_of_processor_time_states_no_fault(held, twist, duration, mean, noise):
    servo, messages = starve(held, twist, duration, mean, noise)
    assert messages == {''}
    assert servo.squeeze.faults.softening == 1.0


ROBOT = core.load_robot('nine_member')
ANGLES = np.arange(6) * math.pi / 3
#: Hexagon with a face almost along a member: the search for its contacts needs many dents.
HEXAGON = core.Polygon(0.15 * np.column_stack([np.cos(ANGLES), np.sin(ANGLES)]), 0.02)
GRIP = core.place_between(ROBOT.home, members_at(ROBOT, 'north/Z'), HEXAGON, 0.04, 0.02)


class Loop:
    """A servo whose rollers and object follow its commands, and the work of its cycles."""

    def __init__(self):
        settings = ServoSettings(GRIP, 0.01, 0.2, squeeze=SqueezeSettings(20.0))
        self.servo, self.now = core.TwistServo(ROBOT, settings), 1.0
        self.travel, self.pose, self.work = ROBOT.home.roller_positions, GRIP.body.pose, []

    def cycle(self, pressures=None):
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

    def start(self):
        """Run cycles until the grip has a belief."""
        while self.belief is None:
            self.cycle()
        return self

    @property
    def belief(self):
        return self.servo.squeeze.tracker.belief


def test_new_dents_delay_the_start_of_a_grip_and_do_not_change_it():
    dent_table.cache_clear()
    loop, known = Loop(), Loop()
    assert 'goes on in the next cycle' in loop.cycle().message
    assert max(loop.start().work) == MAX_CYCLE_WORK
    known.cycle()
    assert known.belief.squeeze == pytest.approx(loop.belief.squeeze)


def test_other_pressures_and_a_lost_balance_stay_within_the_work_of_a_cycle():
    loop = Loop().start()
    pressures = np.array(loop.belief.held.pressures)
    for factor in (1.05, 1.1):
        for _ in range(3):
            assert loop.cycle(tuple(factor * pressures)).command.roller_velocities.any()
        assert loop.belief.held.pressures == pytest.approx(factor * pressures)
    loop.travel = loop.travel + 0.04 * np.cos(np.arange(6))
    dent_table.cache_clear()
    for _ in range(6):
        loop.cycle()
    assert max(loop.work[-6:]) > MAX_CYCLE_WORK // 4
    assert max(loop.work) <= MAX_CYCLE_WORK
