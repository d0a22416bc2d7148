# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Late loops and corrected zeros, as the loop deals with them."""

from dataclasses import replace
import math

from grips import disc_grip, gripped, MASSLESS
from isotruss_ros.core import (
    ElasticObject,
    Grip,
    load_robot,
    Pose,
    RollerFaults,
    SimulatedRobot,
    Status,
    TwistServo,
)
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.estimation.state_estimate import EstimatedTravel
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.inputs import RollerState, StampedInput
from isotruss_ros.core.servo import twist_servo
from isotruss_ros.core.servo.servo_settings import ServoSettings, SqueezeSettings
from nightly import some_now
import numpy as np
import pytest

ROBOT = load_robot('nine_member')
GRIP = disc_grip(ROBOT.home, 'north/Z')
HOME = np.zeros(len(ROBOT.roller_names))
NOW, PERIOD, TIMEOUT = 1000.0, 0.005, 0.2
CONFIG, BODY = gripped(35.0, squeeze=0.1)
HELD_POSE = attach_grip(CONFIG, BODY).pose


def test_corrected_offsets_are_no_roller_travel(monkeypatch):
    made, seen = TwistServo(ROBOT, ServoSettings(GRIP, PERIOD, TIMEOUT)), []
    monkeypatch.setattr(made.detector, 'update', lambda found, *_: seen.append(found.tolist()))
    offsets = np.linspace(0.005, 0.01, len(HOME))
    state = RollerState(0.02 + HOME + offsets, HOME, offsets)
    made.receive(rollers=StampedInput(state, NOW))
    made.decide(NOW)
    assert seen == [pytest.approx((0.02 + HOME).tolist())]


def test_commanded_travel_is_compared_from_measurement_to_measurement(monkeypatch):
    made, seen = TwistServo(ROBOT, ServoSettings(GRIP, PERIOD, TIMEOUT)), []
    monkeypatch.setattr(made.detector, 'update', lambda *given: seen.append(given[2][0]))
    for number, speed in enumerate((0.001, 0.002, 0.004, 0.0)):
        now = NOW + 0.03 * number
        # The measurement is from the middle of the last interval.
        made.receive(rollers=StampedInput(RollerState(HOME, HOME), now - 0.015))
        made.command(np.full(len(HOME), speed), now)
    # Speeds of 1 and 2 mm/s, each for half of the interval.
    assert seen == pytest.approx([0.0, 0.0005, 0.0015, 0.003])


def held_servo():
    """Return a servo that squeezes an object that it holds, and its pose."""
    grip = Grip.at_module(CONFIG.robot, 'north/Z', BODY, 0.5)
    squeeze = SqueezeSettings(30.0)
    settings = ServoSettings(grip, PERIOD, TIMEOUT, squeeze=squeeze, bounds=None)
    return TwistServo(CONFIG.robot, settings), CONFIG.roller_positions, HELD_POSE


def decide(made, positions, pose, now, twist=None):
    """Let a servo decide, with a twist or without."""
    made.receive(
        twist=twist and StampedInput(twist, now),
        rollers=StampedInput(RollerState(positions, np.zeros(len(positions))), now),
        pose=StampedInput(pose, now),
    )
    return made.decide(now).command.status


def test_a_late_loop_counts_no_more_than_the_timeout_as_one_cycle(monkeypatch):
    made, positions, pose = held_servo()
    follow, elapsed = made.squeeze.follow, []

    def note(config, grip, since, *others):
        elapsed.append(since)
        return follow(config, grip, since, *others)

    monkeypatch.setattr(made.squeeze, 'follow', note)
    for now in (NOW, NOW + 0.05, NOW + 10.0):
        status = decide(made, positions, pose, now, (0.0, 0.01, 0.0))
        assert status < Status.HALT_NO_TWIST
    assert elapsed == pytest.approx([0.0, 0.05, TIMEOUT])


def test_ages_of_measurements_count_to_the_middle_of_the_cycle(monkeypatch):
    made, positions, pose = held_servo()
    follow, ages = made.squeeze.follow, []

    def note(config, grip, since, sample, gripped, rollers):
        ages.append((sample[1], rollers[1]))
        return follow(config, grip, since, sample, gripped, rollers)

    monkeypatch.setattr(made.squeeze, 'follow', note)
    decide(made, positions, pose, NOW, (0.0, 0.01, 0.0))
    made.receive(twist=StampedInput((0.0, 0.01, 0.0), NOW + 0.03))
    made.decide(NOW + 0.03)
    middle = 0.5 * PERIOD
    assert ages == [pytest.approx((age + middle, age + middle)) for age in (0.0, 0.03)]


def test_belief_of_a_held_object_is_kept_without_twists():
    made, positions, pose = held_servo()
    decide(made, positions, pose, NOW, (0.0, 0.0, 0.0))
    belief = made.squeeze.belief
    for number in range(1, 60):
        status = decide(made, positions, pose, NOW + number * PERIOD)
        assert status is Status.HALT_NO_TWIST
    assert made.squeeze.belief is belief
    assert made.squeeze.reference is None


@pytest.mark.parametrize(
    ('missing', 'kept'), [(19, True), (22, False)], ids=['within 0.1 s', 'for longer']
)
def test_belief_ends_when_the_pose_is_missing_for_a_tenth_of_a_second(missing, kept):
    made, positions, pose = held_servo()
    decide(made, positions, pose, NOW, (0.0, 0.01, 0.0))
    belief = made.squeeze.belief
    for number in range(1, missing):
        now = NOW + number * PERIOD
        made.receive(twist=StampedInput((0.0, 0.01, 0.0), now), pose=None)
        status = made.decide(now).command.status
        assert status is Status.HALT_NO_OBJECT_POSE
    assert (made.squeeze.belief is belief) is kept
    assert made.squeeze.reference is made.squeeze.fault is None


@pytest.mark.parametrize('status', [Status.HALT_EMERGENCY_STOP, Status.HALT_KINEMATICS])
def test_belief_is_kept_in_an_emergency_stop_and_ends_after_errors(status):
    made, positions, pose = held_servo()
    decide(made, positions, pose, NOW, (0.0, 0.0, 0.0))
    belief = made.squeeze.belief
    made.receive(halt=(status, 'it was drawn'))
    for number in range(1, 30):
        assert decide(made, positions, pose, NOW + number * PERIOD, (0.0, 0.0, 0.0)) is status
    assert made.squeeze.belief is (belief if status is Status.HALT_EMERGENCY_STOP else None)
    assert made.squeeze.fault is None


def test_a_grip_that_the_solver_refuses_is_a_loss(monkeypatch):
    made, positions, pose = held_servo()
    decide(made, positions, pose, NOW, (0.0, 0.0, 0.0))

    def refuse(*_):
        raise GraspError('the contact is beyond the end of the member')

    monkeypatch.setattr(twist_servo, 'solve_twist', refuse)
    status = decide(made, positions, pose, NOW + PERIOD, (0.0, 0.01, 0.0))
    assert status is Status.HALT_NO_GRASP
    assert made.squeeze.fault is Status.HALT_NOT_HELD


def test_a_change_of_the_moved_joint_ends_the_belief():
    made, positions, pose = held_servo()
    decide(made, positions, pose, NOW, (0.0, 0.0, 0.0))
    made.apply(replace(made.settings, joint='Z'))
    assert made.squeeze.belief is None
    for number in range(60):
        assert decide(made, positions, pose, NOW + number * PERIOD) is Status.HALT_NO_TWIST
    assert made.squeeze.belief is None


def test_belief_begins_before_the_first_twist():
    made, positions, pose = held_servo()
    decide(made, positions, pose, NOW)
    belief = made.squeeze.belief
    assert belief.grasp.pose == pytest.approx(pose, abs=1e-3)
    decision = made.decide(NOW)
    assert decision.command.status is Status.HALT_NO_TWIST
    assert decision.squeeze == (belief.squeeze, belief.squeeze_deviation)
    assert decision.pose_gain == made.squeeze.gain


def test_repeated_readings_are_used_once():
    """Each reading is handed over in five cycles, by the second servo as an equal new object."""
    (once, positions, pose), (often, _, _) = held_servo(), held_servo()
    period, rng, spread = 0.01, np.random.default_rng(0), 2e-3**2 * np.eye(len(positions))
    for number in range(25):
        now = NOW + period * number
        if number % 5 == 0:
            seen, stamp = pose + rng.normal(size=3) * [1e-3, 1e-3, math.radians(0.5)], now
            once.receive(
                pose=StampedInput(Pose(*seen), stamp),
                estimate=StampedInput(EstimatedTravel(HOME, spread), stamp),
            )
        often.receive(
            pose=StampedInput(Pose(*seen), stamp),
            estimate=StampedInput(EstimatedTravel(HOME, spread.copy()), stamp),
        )
        for servo in (once, often):
            state = RollerState(positions + 1e-3 * math.sin(0.1 * number), HOME, HOME)
            servo.receive(
                twist=StampedInput((0.0, 0.0, 0.0), now), rollers=StampedInput(state, now)
            )
            assert servo.decide(now).command.status < Status.HALT_NO_TWIST
    assert 'slipped' not in often.squeeze.note()
    assert often.squeeze.belief.pose == pytest.approx(once.squeeze.belief.pose, abs=1e-7)
    assert often.squeeze.belief.squeeze == pytest.approx(once.squeeze.belief.squeeze, abs=1e-5)


def test_one_pose_that_keeps_no_contacts_is_no_loss(monkeypatch):
    made, positions, pose = held_servo()
    decide(made, positions, pose, NOW, (0.0, 0.01, 0.0))
    belief, roll = made.squeeze.belief, twist_servo.roll_object

    def fail(*_):
        raise GraspError('no pose of the object keeps its contacts in the new configuration')

    for number in range(1, 20):
        monkeypatch.setattr(twist_servo, 'roll_object', fail if number == 10 else roll)
        status = decide(made, positions, pose, NOW + number * PERIOD, (0.0, 0.01, 0.0))
        assert status < Status.HALT_NO_TWIST
    assert made.squeeze.belief is belief
    assert made.squeeze.fault is None


def test_a_lost_object_without_contacts_is_reported_by_the_belief():
    made, positions, pose = held_servo()
    decide(made, positions, pose, NOW, (0.0, 0.01, 0.0))
    decide(made, positions, Pose(5.0, 5.0, 0.0), NOW + PERIOD, (0.0, 0.01, 0.0))
    status = decide(made, positions, Pose(5.0, 5.0, 0.0), NOW + 2 * PERIOD, (0.0, 0.01, 0.0))
    assert status is Status.HALT_NOT_HELD
    assert made.squeeze.fault is Status.HALT_NOT_HELD


@pytest.mark.parametrize(('repeats', 'stopped'), [(1, False), (20, False), (60, True)])
def test_a_tracker_that_repeats_its_pose_beyond_the_timeout_stops_the_object(repeats, stopped):
    config, body = gripped(35.0, squeeze=0.1)
    held, period = ElasticObject(body, 0.5), 0.01
    plant = SimulatedRobot(config, held, RollerFaults())
    plant.advance(0.0)
    squeeze = SqueezeSettings(held.grasp.squeeze, max_utilisation=math.inf)
    grip = Grip.at_module(config.robot, 'north/Z', body, 0.5)
    servo = TwistServo(config.robot, ServoSettings(grip, period, TIMEOUT, squeeze=squeeze))
    start, statuses = plant.object_pose, []
    for number in range(150):
        now = number * period
        if number % repeats == 0 and number < 120:
            pose = plant.object_pose
        state = RollerState(plant.roller_positions, plant.roller_velocities)
        servo.receive(
            twist=StampedInput((0.05, 0.0, 0.0), now),
            rollers=StampedInput(state, now),
            pose=StampedInput(pose, now),
        )
        command = servo.decide(now).command
        statuses.append(command.status)
        plant.command(command.roller_velocities)
        plant.advance(period)
    assert (Status.HALT_STALE_OBJECT_POSE in statuses[:120]) is stopped
    assert statuses[-1] is Status.HALT_STALE_OBJECT_POSE
    # A new pose resumes the motion.
    if stopped:
        assert statuses[59] is Status.HALT_STALE_OBJECT_POSE
        assert statuses[61] < Status.HALT_NO_TWIST
    assert plant.object_pose.x - start.x > 0.01


@pytest.mark.parametrize(
    ('rollers_late', 'pose_late', 'every'),
    some_now([(5, 0, 1), (0, 5, 1), (0, 1, 2), (0, 0, 1), (1, 0, 1)]),
)
def test_a_turn_by_rollers_that_follow_late_is_no_slip(rollers_late, pose_late, every):
    config, body = gripped(35.0, squeeze=0.1)
    held, period, sent, lengths = ElasticObject(body, 0.5), 0.01, [], []
    plant = SimulatedRobot(config, held, RollerFaults())
    plant.advance(0.0)
    squeeze = SqueezeSettings(held.grasp.squeeze, max_utilisation=math.inf, **MASSLESS)
    grip = Grip.at_module(config.robot, 'north/Z', body, 0.5)
    servo = TwistServo(config.robot, ServoSettings(grip, period, 1.0, squeeze=squeeze))
    for number in range(60):
        now = number * period
        # A busy machine: the rollers keep their last command, and nothing is measured.
        stands = 20 <= number < 45
        if not stands:
            state = RollerState(plant.roller_positions, plant.roller_velocities)
            sent.append((number, StampedInput(state, now), StampedInput(plant.object_pose, now)))
        if number % every == 0:
            rollers = [each for when, each, _ in sent if when <= max(number - rollers_late, 0)]
            poses = [each for when, _, each in sent if when <= max(number - pose_late, 0)]
            twist = StampedInput((0.0, 0.0, 0.8 * now), now)
            servo.receive(twist=twist, rollers=rollers[-1], pose=poses[-1])
            decision = servo.decide(now)
            assert decision.command.status < Status.HALT_NO_TWIST
            lengths.append(servo.squeeze.belief.state.walk.length)
        if not stands:
            plant.command(decision.command.roller_velocities)
        plant.advance(period)
    assert held.grasp.squeeze == pytest.approx(squeeze.force, rel=0.05)
    assert max(lengths) < 5e-4
    assert servo.squeeze.belief.state.delay < 5e-3
