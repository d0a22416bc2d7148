# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of a grip that the servo detects from the poses of a robot at rest."""

from copy import deepcopy
from dataclasses import replace
from functools import cache
import math

from grips import gripped
from isotruss_ros.core import Grip, Pose, Status
from isotruss_ros.core.estimation.state_estimate import is_squeeze_known
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.inputs import StampedInput
from nightly import some_now
import numpy as np
import pytest
import robots
from squeeze_loop import SqueezeLoop, TIMEOUT

CONFIG, BODY = gripped(35.0, squeeze=0.1)
MODEL = attach_grip(CONFIG, BODY)
GRIP = Grip.at_module(CONFIG.robot, 'north/Z', MODEL.body, 0.5)
FREQUENCY = 12.0
ROLLERS = np.zeros(len(CONFIG.robot.roller_names))
CLOSED, GONE = (0.0, 0.0, 0.0), (5.0, 5.0, 0.0)


@cache
def loop_at_rest(load, more, timeout):
    options = {'pose_gain': 4.0, 'frequency': FREQUENCY, 'load': load, 'more': more}
    loop = SqueezeLoop(CONFIG, GRIP, follows=False, servo={'timeout': timeout}, **options)
    for number in range(6):
        loop.cycle(away=(0.0, 1e-5 * (-1) ** number, 0.0))
    return loop


def held(load=0.0, more=1.0, timeout=TIMEOUT):
    """Return a loop after six poses, with an expected load [N]; 0: that of the estimator."""
    return deepcopy(loop_at_rest(load, more, timeout))


def shake(loop, twist=CLOSED, every=1):
    """Shake the object, with a pose in some cycles, until it oscillates; return the decision."""
    for number in range(125):
        displacement = 6e-3 * math.sin(FREQUENCY * number * loop.period)
        repeated = {'pose': loop.servo.inputs.pose} if number % every else {}
        decision = loop.cycle(twist, away=(0.0, displacement, 0.0), **repeated)
        if decision.command.status is Status.HALT_OSCILLATES:
            return decision
    raise AssertionError('no oscillation')


def slip(speed=0.03, **settings):
    """Return a loop whose object moves along the members until a fault, and the decision."""
    loop = held(**settings)
    for number in range(100):
        away = (0.0, speed * loop.period * number, 0.0)
        decision = loop.cycle(away=away)
        if decision.command.status >= Status.HALT_NO_TWIST:
            return loop, decision, away
    raise AssertionError('no slip')


@pytest.mark.parametrize(('every', 'gains'), some_now([(2, (2.0,)), (1, (2.0, 1.0))]))
def test_an_oscillation_stops_the_rollers_for_one_second_and_halves_the_gain(every, gains):
    loop = held(load=40.0, more=1.1)
    for gain in gains:
        command = shake(loop, (0.02, 0.0, 0.0), every).command
        assert not command.roller_velocities.any()
        assert (command.achieved_twist.any(), command.scale) == (False, 0.0)
        # Without noise, the poses of an object at rest are equal.
        decisions = [loop.cycle() for _ in range(52)]
        assert loop.statuses[-52:].count(Status.HALT_OSCILLATES) in (49, 50)
        reduced = f'the object oscillates: the pose gain is reduced to {gain:.0f} 1/s'
        assert decisions[0].message == reduced
        assert decisions[-1].command.status < Status.HALT_NO_TWIST
        assert decisions[-1].pose_gain == gain


def test_roller_commands_acknowledge_faults_and_restore_the_gain():
    for loop in (held(load=40.0), slip()[0]):
        if loop.statuses[-1] is not Status.HALT_SLIPPED:
            shake(loop)
        loop.servo.command(ROLLERS, loop.now)
        loop.now += loop.period
        decision = loop.cycle()
        assert decision.command.status < Status.HALT_NO_TWIST
        assert decision.pose_gain == 4.0


def test_new_settings_of_the_squeeze_acknowledge_a_fault():
    loop, _, _ = slip()
    settings = loop.servo.settings
    loop.servo.apply(replace(settings, squeeze=replace(settings.squeeze, force=31.0)))
    assert loop.cycle().command.status < Status.HALT_NO_TWIST


@pytest.mark.parametrize(
    ('jump', 'fault'),
    [
        ((0.0, 0.019, 0.0), Status.HALT_SLIPPED),
        ((0.0, 0.023, 0.0), Status.HALT_NOT_HELD),
        ((0.012, 0.012, 0.0), Status.HALT_SLIPPED),
        ((0.017, -0.017, 0.0), Status.HALT_NOT_HELD),
        ((0.0, 0.0, 0.023 / MODEL.arm), Status.HALT_NOT_HELD),
    ],
)
def test_a_jump_by_more_than_20_mm_is_a_loss(jump, fault):
    assert held().cycle(away=jump).command.status is fault


def test_one_pose_at_which_the_object_would_not_touch_the_members_is_no_fault():
    config, body = gripped(35.0, squeeze=0.04)
    grip = Grip.at_module(config.robot, 'north/Z', attach_grip(config, body).body, 0.5)
    start, end = robots.member_ends(config, 'north/P-Z')
    axis = (end - start) / abs(end - start)
    side = ((grip.body.middle - start) / axis).imag
    away = 8e-3 * 1j * np.sign(side) * axis  # normal to the member, from it
    radii = 0.15 + 0.5 * config.robot.description.tube_diameter
    assert abs(side) < radii < abs(side) + abs(away)
    loop = SqueezeLoop(config, grip, follows=False, pose_gain=4.0, frequency=FREQUENCY)
    for number in range(12):
        loop.cycle((0.0, 0.01, 0.0), away=(away.real, away.imag, 0.0) if number == 8 else CLOSED)
    assert max(loop.statuses) < Status.HALT_NO_TWIST


def test_a_slipped_object_is_not_moved_while_its_squeeze_is_controlled():
    loop, _, away = slip(more=1.05)
    command = loop.cycle((0.02, 0.0, 0.1), away=away).command
    assert (command.status, command.scale) == (Status.HALT_SLIPPED, 0.0)
    assert np.abs(command.achieved_twist).max() < 2e-3
    assert command.roller_velocities.any()


def test_the_message_of_a_slip_has_its_length_causes_and_the_next_step():
    _, decision, _ = slip()
    assert decision.command.status is Status.HALT_SLIPPED
    moved, causes = decision.message.split(' mm against the members, or ')
    assert 2 <= int(moved.removeprefix('the object moved by ')) <= 25
    assert causes.startswith('the tracker turned or jumped; next step: resume the grip')
    assert 'service resume_grip' in causes
    assert not is_squeeze_known(*decision.squeeze)


def test_the_first_fault_remains_when_the_object_is_lost_or_returns():
    loop, decision, _ = slip()
    first = decision.command.status, decision.message
    for away in ((0.0, 0.1, 0.0), CLOSED, CLOSED):
        later = loop.cycle(away=away)
        assert (later.command.status, later.message.split('; held')[0]) == first
    for _ in range(30):
        at_rest = loop.cycle(None).command
    assert at_rest.status is Status.HALT_NO_TWIST
    assert loop.cycle().command.status is first[0]


def test_a_loss_during_an_oscillation_is_a_fault_that_remains():
    loop = held(load=40.0)
    shake(loop)
    for _ in range(51):
        decision = loop.cycle(away=(0.0, 0.1, 0.0))
    assert decision.command.status is Status.HALT_NOT_HELD
    assert 'next step: pick up the object' in decision.message


def test_a_short_slip_is_noted_for_three_seconds():
    loop = held(timeout=0.5)
    messages = [
        loop.cycle(away=(0.0, 6e-3 + 3e-4 * (-1) ** number, 0.0), elapsed=0.1).message
        for number in range(36)
    ]
    assert max(loop.statuses) < Status.HALT_NO_TWIST
    assert all('slipped by 6 mm, held' in message for message in messages[:25])
    assert 'slipped' not in messages[-1]


@pytest.mark.parametrize('mode', ['same value', 'same stamp'])
def test_a_repeated_pose_is_no_slip(mode):
    loop, rng = held(), np.random.default_rng(0)
    for number in range(60):
        if number % 5 == 0:
            seen, stamp = MODEL.pose + rng.normal(size=3) * (1e-3, 1e-3, 9e-3), loop.now
        if mode == 'same value':
            stamp = loop.now
        else:
            seen = seen + 1e-12 * rng.normal(size=3)
        decision = loop.cycle(pose=StampedInput(Pose(*seen), stamp))
        assert decision.command.status < Status.HALT_NO_TWIST
        assert 'slipped' not in decision.message


def test_an_object_that_is_taken_away_at_rest_is_no_fault():
    loop = held()
    for _ in range(60):
        decision = loop.cycle(None, away=GONE)
    assert decision.command.status is Status.HALT_NO_TWIST
    assert decision.squeeze is None
    loop.cycle(None)
    assert loop.cycle().command.status < Status.HALT_NO_TWIST
