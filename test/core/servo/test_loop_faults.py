# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of the loop and of a grip: late loops, missing inputs, repeated poses, and slip."""

from copy import deepcopy
from dataclasses import replace
from functools import cache
import math

from grips import disc_grip, gripped
from isotruss_ros.core import Grip, load_robot, Pose, Status, TwistServo
from isotruss_ros.core.estimation.state_estimate import EstimatedTravel, is_squeeze_known
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.inputs import RollerState, StampedInput
from isotruss_ros.core.servo.servo_settings import ServoSettings
from nightly import some_now
import numpy as np
import pytest
import robots
from squeeze_loop import SqueezeLoop, TIMEOUT

ROBOT = load_robot('nine_member')
GRIP = disc_grip(ROBOT.home, 'north/Z')
COUNT = len(ROBOT.roller_names)
PERIOD = 0.01
CONFIG, BODY = gripped(35.0, squeeze=0.1)
HELD = Grip.at_module(CONFIG.robot, 'north/Z', BODY, 0.5)


@pytest.mark.parametrize('is_offset', [True, False])
def test_corrected_offsets_are_no_roller_travel(is_offset):
    servo = TwistServo(ROBOT, ServoSettings(GRIP, 0.03, 1.0, failure_time=1.0))
    for now in 0.03 * np.arange(67):
        positions = np.full(COUNT, 0.01 * now)
        state = RollerState(positions, np.zeros(COUNT), is_offset * positions)
        servo.receive(rollers=StampedInput(state, now - 0.015))
        servo.command(np.full(COUNT, 0.01), now)
    assert servo.failed == (frozenset(ROBOT.roller_names) if is_offset else frozenset())


def loop_of(**settings):
    """Return the loop of an object at rest."""
    return SqueezeLoop(CONFIG, HELD, period=PERIOD, follows=False, **settings)


def test_a_late_loop_counts_no_more_than_the_timeout_as_one_cycle():
    loop, speed = loop_of(), 0.01
    times = 0.05, 0.05, 10.0, 1.0
    places = [loop.cycle((0.0, speed, 0.0), elapsed).desired_pose for elapsed in times]
    # In the first cycle the acceleration is limited.
    moved = np.diff(places, axis=0)[1:, 1]
    assert moved == pytest.approx([0.05 * speed, TIMEOUT * speed], rel=0.02)


@pytest.mark.parametrize(
    ('status', 'cycles', 'kept'),
    [
        (Status.HALT_NO_TWIST, 30, True),
        (Status.HALT_NO_OBJECT_POSE, 9, True),
        (Status.HALT_NO_OBJECT_POSE, 11, False),  # longer than 0.1 s
        (Status.HALT_EMERGENCY_STOP, 15, True),
        (Status.HALT_KINEMATICS, 15, False),
    ],
)
def test_belief_of_a_held_object_is_kept_as_long_as_its_pose_is_known(status, cycles, kept):
    loop = loop_of()
    before, first = loop.cycle(None), loop.cycle()
    assert before.command.status is Status.HALT_NO_TWIST
    assert before.squeeze == pytest.approx(first.squeeze, rel=0.1)
    assert before.pose_gain == first.pose_gain
    assert first.desired_pose == pytest.approx(loop.plant.object_pose, abs=1e-3)
    inputs = {
        Status.HALT_NO_TWIST: {'twist': None},
        Status.HALT_NO_OBJECT_POSE: {'pose': None},
    }.get(status, {'halt': (status, 'singular')})
    for _ in range(cycles):
        decision = loop.cycle(**inputs)
        assert decision.command.status is status
        assert decision.desired_pose is None
    assert decision.squeeze == (pytest.approx(first.squeeze, rel=0.1) if kept else None)
    assert loop.cycle(halt=None).command.status < Status.HALT_NO_TWIST


def test_a_change_of_the_moved_joint_ends_the_belief():
    loop = loop_of()
    loop.cycle()
    loop.servo.apply(replace(loop.servo.settings, joint='Z'))
    for _ in range(30):
        decision = loop.cycle(None)
        assert decision.command.status is Status.HALT_NO_TWIST
        assert decision.squeeze is None


def test_repeated_readings_are_used_once():
    """Each reading is handed over in five cycles, to the second servo as an equal new object."""
    loops = once, often = [loop_of(noise=1e-3) for _ in range(2)]
    spread = 2e-3**2 * np.eye(COUNT)
    for number in range(25):
        if number % 5 == 0:
            stamp, error = once.now, 1e-3 * np.random.default_rng(number).normal(size=3)
            seen = Pose(*(once.plant.object_pose + error))
        for loop in loops:
            inputs = {}
            if loop is often or number % 5 == 0:
                known = EstimatedTravel(np.zeros(COUNT), spread.copy())
                inputs['estimate'] = StampedInput(known, stamp)
            pose = once.servo.inputs.pose if number % 5 and loop is once else None
            loop.cycle(pose=pose or StampedInput(Pose(*seen), stamp), **inputs)
    one, other = (loop.decisions[-1] for loop in loops)
    assert other.command.status < Status.HALT_NO_TWIST
    assert 'slipped' not in other.message
    assert other.desired_pose == pytest.approx(one.desired_pose, abs=1e-7)
    assert other.squeeze == pytest.approx(one.squeeze, abs=1e-5)


@pytest.mark.parametrize(('repeats', 'stopped'), [(5, False), (15, True)])
def test_a_tracker_that_repeats_its_pose_beyond_the_timeout_stops_the_object(repeats, stopped):
    loop = SqueezeLoop(CONFIG, HELD, period=0.04, pose_gain=None, load=0.0)
    start = loop.plant.object_pose
    for number in range(23):
        if number % repeats == 0 and number < 16:
            pose = loop.plant.object_pose
        loop.cycle((0.05, 0.0, 0.0), pose=StampedInput(pose, loop.now))
    assert (Status.HALT_STALE_OBJECT_POSE in loop.statuses[:16]) is stopped
    assert loop.statuses[-1] is Status.HALT_STALE_OBJECT_POSE
    # A new pose resumes the motion.
    if stopped:
        assert loop.statuses[14] is Status.HALT_STALE_OBJECT_POSE
        assert loop.statuses[16] < Status.HALT_NO_TWIST
    assert loop.plant.object_pose.x - start.x > 0.01


def test_a_late_pose_of_an_object_that_begins_to_move_is_not_repeated():
    loop = SqueezeLoop(CONFIG, HELD, period=0.05, pose_gain=None, load=0.0)
    poses = 4 * [loop.plant.object_pose]
    for number in range(26):
        pose = StampedInput(poses[number], loop.now - 0.19)
        decision = loop.cycle((0.1 * (number > 18), 0.0, 0.0), pose=pose)
        poses.append(loop.plant.object_pose)
        assert decision.command.status < Status.HALT_NO_TWIST, decision.message
    assert poses[-1].x - poses[0].x > 0.01


@pytest.mark.parametrize(
    ('rollers_late', 'pose_late', 'every'),
    some_now([(5, 0, 1), (0, 5, 1), (0, 1, 2), (0, 0, 1), (1, 0, 1)]),
)
def test_a_turn_by_rollers_that_follow_late_is_no_slip(rollers_late, pose_late, every):
    loop = SqueezeLoop(CONFIG, HELD, period=0.01, servo={'timeout': 1.0})
    states, poses, first = [], [], loop.now
    for number in range(0, 48, every):
        # A busy machine: the rollers keep their last command, and nothing is measured.
        loop.sends = not 15 <= number < 40
        if loop.sends:
            velocities = loop.plant.roller_velocities
            state = RollerState(loop.plant.roller_positions, velocities)
            states.append(StampedInput(state, loop.now))
            poses.append(StampedInput(loop.plant.object_pose, loop.now))
        twist = (0.0, 0.0, 0.8 * (loop.now - first))
        rollers = states[-1 - rollers_late :][0]  # noqa: E203
        pose = poses[-1 - pose_late :][0]  # noqa: E203
        decision = loop.cycle(twist, every * loop.period, rollers=rollers, pose=pose)
        assert decision.command.status < Status.HALT_NO_TWIST
        assert 'slipped' not in decision.message
    assert loop.squeeze == pytest.approx(loop.target, rel=0.05)
    assert decision.pose_delay < 5e-3


def test_a_third_of_the_delay_of_a_tracker_is_estimated_within_three_half_swings():
    loop, late, poses = SqueezeLoop(CONFIG, HELD, period=0.03), 2, []
    for number in range(30):
        poses.append(loop.plant.object_pose)
        twist = (0.05 * np.sin(2.0 * np.pi * number / 20), 0.0, 0.0)
        pose = StampedInput(poses[-1 - late :][0], loop.now)  # noqa: E203
        decision = loop.cycle(twist, pose=pose)
        assert decision.command.status < Status.HALT_NO_TWIST
    delay = late * loop.period
    assert delay / 3.0 < decision.pose_delay < delay


MODEL = attach_grip(CONFIG, BODY)
HELD_GRIP = Grip.at_module(CONFIG.robot, 'north/Z', MODEL.body, 0.5)
FREQUENCY = 12.0
ROLLERS = np.zeros(len(CONFIG.robot.roller_names))
CLOSED, GONE = (0.0, 0.0, 0.0), (5.0, 5.0, 0.0)


@cache
def loop_at_rest(load, more, timeout):
    options = {'pose_gain': 4.0, 'frequency': FREQUENCY, 'load': load, 'more': more}
    loop = SqueezeLoop(CONFIG, HELD_GRIP, follows=False, servo={'timeout': timeout}, **options)
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
