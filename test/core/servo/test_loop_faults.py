# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Late loops, missing inputs, repeated poses and corrected offsets in the loop of the servo."""

from dataclasses import replace

from grips import disc_grip, gripped
from isotruss_ros.core import Grip, load_robot, Pose, Status, TwistServo
from isotruss_ros.core.estimation.state_estimate import EstimatedTravel
from isotruss_ros.core.inputs import RollerState, StampedInput
from isotruss_ros.core.servo.servo_settings import ServoSettings
from nightly import some_now
import numpy as np
import pytest
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
