# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Path servo: invalid inputs stop the object."""

import math

from hypothesis import given
from isotruss_ros.core import ObjectPath, Pose, Status
from isotruss_ros.core.errors import PathError
from isotruss_ros.core.inputs import InputError, LatestInputs, RejectedInput, StampedInput
from isotruss_ros.core.paths.path_servo import PathOutcome, PathServo, ServoFeedback
from isotruss_ros.core.paths.path_tracking import PathPhase, TrackingSettings
import numpy as np
import pytest
import robots

PERIOD, TIMEOUT = 0.01, 0.2
PATH = ObjectPath([(0.0, 0.0, 0.0), (0.05, 0.0, 0.0)], 0.05, 0.2)
OBEYS = ServoFeedback(Status.OK, 1.0, '')


def begun(**settings):
    """Return a servo on its path, in the cycle before time 10, with an object that obeys."""
    servo = PathServo(PERIOD, TIMEOUT, LatestInputs())
    tell(servo, 10.0 - PERIOD)
    servo.begin(PATH, TrackingSettings(**settings), 10.0 - PERIOD)
    return servo


def tell(servo, now, pose=(0.0, 0.0, 0.0), answer=OBEYS):
    servo.inputs.pose = StampedInput(Pose(*pose), now)
    servo.inputs.servo_feedback = StampedInput(answer, now)


def run(servo, seconds, start=10.0, answer=OBEYS, follows=True):
    """Let an object follow; return the steps."""
    pose, steps = np.zeros(3), []
    for cycle in range(int(seconds / PERIOD)):
        now = start + cycle * PERIOD
        tell(servo, now, pose, answer)
        steps.append(servo.decide(now))
        if steps[-1].outcome is not None:
            break
        pose = pose + follows * PERIOD * steps[-1].tracking.twist
    return steps


def test_age_of_the_pose_is_that_of_its_stamp():
    servo, pose, past, errors = begun(), np.zeros(3), [], []
    for cycle in range(80):
        now = 10.0 + cycle * PERIOD
        past.append(pose)
        age = min(cycle, 10) * PERIOD
        servo.inputs.pose = StampedInput(Pose(*past[max(0, cycle - 10)]), now - age)
        servo.inputs.servo_feedback = StampedInput(OBEYS, now)
        step = servo.decide(now)
        errors.append(step.tracking.position_error)
        pose = pose + PERIOD * step.tracking.twist
    assert max(errors) < 1e-9
    assert pose[0] > 0.01


@pytest.mark.parametrize(
    ('pose', 'words'),
    [
        (None, 'none received yet'),
        (RejectedInput('in another frame'), 'in another frame'),
        (StampedInput(Pose(0.0, 0.0, 0.0), 9.7), 'must be at most 0.2 s'),
        (StampedInput(Pose(0.0, 0.0, 0.0), 11.0), 'in the future'),
    ],
)
def test_invalid_pose_stops_the_path(pose, words):
    servo = begun()
    servo.inputs.pose = pose
    step = servo.decide(10.0)
    assert step.outcome is PathOutcome.STOPPED
    assert words in step.message
    assert step.tracking is None
    with pytest.raises(InputError) as caught:
        servo.begin(PATH, TrackingSettings(), 10.0)
    assert caught.value.name == 'object_pose'


HALTED = [(int(status), 0.0) for status in Status if status >= 30]
HALTED += [(99, 1.0), *((0, scale) for scale in (math.nan, math.inf, -0.1, 1.1))]


@pytest.mark.parametrize(
    'servo_feedback',
    [
        *(None, RejectedInput('nonsense'), StampedInput(OBEYS, 9.7), StampedInput(OBEYS, 11.0)),
        *(StampedInput(ServoFeedback(*halted, ''), 10.0) for halted in HALTED),
    ],
)
def test_path_time_stops_while_the_robot_is_halted(servo_feedback):
    servo = begun()
    servo.inputs.servo_feedback = servo_feedback
    step = servo.decide(10.0)
    assert step.outcome is None
    assert step.tracking.phase is PathPhase.HELD
    assert not step.tracking.twist.any()
    assert servo.tracker.clock.rate == 0.0


@pytest.mark.parametrize(
    ('last', 'words'),
    [
        (None, 'none received yet'),
        (StampedInput(OBEYS, 10.0), 'must be at most 0.2 s'),
        (RejectedInput('nonsense'), 'nonsense'),
        (StampedInput(ServoFeedback(0, math.nan, ''), 10.0), 'scale nan'),
    ],
)
def test_a_path_ends_one_timeout_after_the_last_valid_feedback(last, words):
    servo = begun(progress_timeout=60.0)
    end = 10.0 + TIMEOUT if isinstance(last, StampedInput) else 10.0 - PERIOD + TIMEOUT
    for cycle in range(60):
        now = 10.0 + cycle * PERIOD
        servo.inputs.pose = StampedInput(Pose(0.0, 0.0, 0.0), now)
        servo.inputs.servo_feedback = last
        step = servo.decide(now)
        if step.outcome is not None:
            break
    assert step.outcome is PathOutcome.STOPPED
    assert words in step.message
    assert step.tracking is None
    assert now == pytest.approx(end, abs=2.0 * PERIOD)


@pytest.mark.parametrize('status', [status for status in Status if status < 30])
def test_a_slowed_robot_continues_on_its_path(status):
    servo = begun()
    tell(servo, 10.0, answer=ServoFeedback(status, 0.5, ''))
    step = servo.decide(10.0)
    assert step.outcome is None
    assert step.tracking.twist[0] > 0.0


def test_path_is_slowed_by_limits_of_speed_and_not_by_sliding_along_limits():
    answers = (Status.OK, 1.0), (Status.SLIDING, 0.6), (Status.SLOWED_ROLLER_SPEED, 0.6)
    free, sliding, slowed = (
        len(run(begun(), 60.0, answer=ServoFeedback(*answer, ''))) for answer in answers
    )
    assert sliding == free
    assert slowed > 3 * free


def test_a_path_without_progress_ends_with_the_reason_of_the_robot():
    halted = ServoFeedback(Status.HALT_EMERGENCY_STOP, 0.0, 'somebody pressed the button')
    steps = run(begun(progress_timeout=0.5), 2.0, answer=halted)
    assert steps[-1].outcome is PathOutcome.STOPPED
    assert steps[-1].message.endswith('manipulation: somebody pressed the button')
    assert len(steps) * PERIOD == pytest.approx(0.5, abs=0.05)
    assert not any(step.tracking.twist.any() for step in steps)


def test_an_object_of_low_frequency_starts_and_stops_slowly():
    firm, soft = (
        len(run(begun(), 10.0, answer=ServoFeedback(Status.OK, 1.0, '', frequency)))
        for frequency in (0.0, 5.0)
    )
    assert PERIOD * (soft - firm) == pytest.approx(0.5, abs=0.05)  # a ramp of 1 s against 0.5 s


@pytest.mark.parametrize('pose', [(0.0, 0.011, 0.0), (0.0, 0.0, 0.21), (0.0, 0.0, math.pi)])
def test_path_must_begin_where_the_object_is(pose):
    servo = PathServo(PERIOD, TIMEOUT, LatestInputs())
    tell(servo, 10.0, pose)
    with pytest.raises(PathError, match='the path begins'):
        servo.begin(PATH, TrackingSettings(), 10.0)
    assert servo.tracker is None
    # The same angle after a turn.
    tell(servo, 10.0, (0.0, 0.0, 2.0 * math.pi))
    servo.begin(PATH, TrackingSettings(), 10.0)


@robots.examples(200)
@given(robots.generators())
def test_no_input_raises_or_exceeds_the_speed(rng):
    def number():
        return float(rng.choice([0.0, 1e-3, -0.01, rng.normal(), 1e300, np.inf, np.nan]))

    servo = begun()
    for now in 10.0 + np.cumsum(rng.choice([0.0, PERIOD, 0.1, -1.0], 5)):
        stamps = now + rng.choice([0.0, -0.1, -1e9, 1e9], 2)
        feedback = ServoFeedback(int(rng.integers(256)), number(), '')
        poses = StampedInput(Pose(number(), number(), number()), stamps[0])
        servo.inputs.pose = (poses, poses, None, RejectedInput(''))[rng.integers(4)]
        answers = StampedInput(feedback, stamps[1])
        servo.inputs.servo_feedback = (answers, answers, None, RejectedInput(''))[rng.integers(4)]
        step = servo.decide(now)
        if step.outcome is not None:
            break
        assert np.isfinite(step.tracking.twist).all()
        assert np.hypot(*step.tracking.twist[:2]) <= 1.5 * PATH.speed * (1.0 + 1e-9)
