# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Path tracking: errors by formulas, stability of the sampled loop, and invalid inputs."""

from collections import deque
import math

from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros.core import ObjectPath, PathTracker, Pose, Status
from isotruss_ros.core.errors import PathError
from isotruss_ros.core.inputs import (
    InputError,
    LatestInputs,
    MAX_TIMEOUT,
    RejectedInput,
    StampedInput,
)
from isotruss_ros.core.paths.path_servo import PathOutcome, PathServo, ServoFeedback
from isotruss_ros.core.paths.path_tracking import FINISHED, PathClock, PathPhase, TrackingSettings
import numpy as np
import pytest
import robots

PERIOD = 0.01
SPEED, TURN_RATE = 0.02, 0.2
LINE = ObjectPath([(0.0, 0.0, 0.0), (0.2, 0.0, 0.0)], SPEED, TURN_RATE)
#: A path on which everything changes, through more than a full turn.
TURNS = ObjectPath(
    [(0.05 * i, 0.05 * math.sin(i), 1.5 * i) for i in range(7)], SPEED, TURN_RATE, smooth=True
)


class Object:
    """Object with a slip, a delay of measurements [cycles], and a largest speed [m/s]."""

    def __init__(self, pose, slip=0.0, delay=0, most=math.inf, tells=True, noise=0.0, drift=None):
        self.pose = np.array(pose, dtype=float)
        self.scale = 1.0
        self._keeps, self._most, self._tells, self._noise = 1.0 - slip, most, tells, noise
        self._drift = np.zeros(3) if drift is None else np.array(drift)
        self._measured = deque([self.pose.copy()] * (delay + 1), maxlen=delay + 1)
        self._random = np.random.default_rng(5)
        self.age = delay * PERIOD

    def measured(self):
        """Return the measured pose, with a wrapped angle."""
        x, y, angle = self._measured[0] + self._noise * self._random.standard_normal(3)
        return Pose(x, y, math.remainder(angle, 2.0 * math.pi))

    def move(self, twist, duration=PERIOD):
        scale = min(1.0, self._most / max(math.hypot(*twist[:2]), 1e-12))
        self.scale = scale if self._tells else 1.0
        self.pose += duration * (self._keeps * scale * twist + self._drift)
        self._measured.append(self.pose.copy())


def follow(path, thing, settings=None, seconds=200.0, held=lambda _time: False):
    """Follow to the end; return the tracker and its steps."""
    tracker = PathTracker(path, settings or TrackingSettings(), PERIOD)
    steps = []
    for cycle in range(int(seconds / PERIOD)):
        halted = held(cycle * PERIOD)
        steps.append(tracker.update(thing.measured(), thing.age, PERIOD, thing.scale, halted))
        if steps[-1].phase in FINISHED:
            return tracker, steps
        thing.move(steps[-1].twist)
    raise AssertionError(f'not finished after {seconds} s: {steps[-1]}')


@pytest.mark.parametrize('path', [LINE, TURNS], ids=['line', 'turns'])
@pytest.mark.parametrize('delay', [0, round(0.95 * MAX_TIMEOUT / PERIOD)])
def test_an_ideal_object_has_no_tracking_error_at_any_delay(path, delay):
    tracker, steps = follow(path, Object(path.poses[0], delay=delay))
    assert steps[-1].phase is PathPhase.REACHED
    assert tracker.max_position_error < 1e-9
    assert tracker.max_angle_error < 1e-9
    duration = path.duration + tracker.settings.ramp_time
    assert len(steps) * PERIOD == pytest.approx(duration, abs=0.1)
    for cycle in range(0, len(steps), 100):
        left = (len(steps) - cycle) * PERIOD
        assert steps[cycle].time_left == pytest.approx(left, abs=0.1)


def test_errors_decay_at_the_rate_of_the_gains():
    settings = TrackingSettings(position_gain=1.0, angle_gain=2.0)
    # 4 mm and 0.04 rad off across the path; nothing is bounded or slowed yet.
    thing = Object((0.0, 0.004, 0.04))
    tracker = PathTracker(LINE, settings, PERIOD)
    for _ in range(100):
        tracking = tracker.update(thing.measured(), 0.0, PERIOD)
        thing.move(tracking.twist)
    assert thing.pose[1] == pytest.approx(0.004 * math.exp(-1.0), rel=0.01)
    assert thing.pose[2] == pytest.approx(0.04 * math.exp(-2.0), rel=0.03)


def test_feedback_is_at_most_half_of_the_limits_of_the_path():
    settings = TrackingSettings(position_gain=20.0, angle_gain=20.0)
    tracker = PathTracker(LINE, settings, PERIOD)
    twist = tracker.update(Pose(0.0, 0.0054, -0.19), 0.0, PERIOD).twist
    assert twist[:2] == pytest.approx([0.0, -0.5 * SPEED], abs=0.05 * SPEED)
    assert twist[2] == pytest.approx(0.5 * TURN_RATE)


def gain_at(age, period, wanted):
    """Return the gain that the tracker uses when the pose is this old [1/s]."""
    small = 1e-6
    settings = TrackingSettings(position_gain=wanted, angle_gain=wanted)
    tracker = PathTracker(LINE, settings, period)
    twist = tracker.update(Pose(0.0, -small, -small), age, 0.0).twist
    assert twist[1] == pytest.approx(twist[2])
    return twist[1] / small


@pytest.mark.parametrize('delay', [0, 1, 2, 3, 5, 10, 20, 50, 200])
def test_loop_with_delay_is_stable_with_a_margin_of_two(delay):
    # e[k + 1] = e[k] - K h e[k - d] decays where all roots of its polynomial are in the unit disc.
    gain = gain_at(delay * PERIOD, PERIOD, wanted=1e6)

    def radius(gain):
        polynomial = np.zeros(delay + 2)
        polynomial[:2] = 1.0, -1.0
        polynomial[-1] += gain * PERIOD
        return np.abs(np.roots(polynomial)).max()

    assert radius(gain) < 1.0
    assert radius(2.0 * gain) <= 1.0 + 1e-9
    assert radius(4.0 * gain) > 1.0  # and it does not give away more than another factor of two
    # The exact bound (Levin and May 1976).
    bound = 2.0 * math.sin(0.5 * math.pi / (2 * delay + 1)) / PERIOD
    assert 0.25 * bound < gain <= 0.5 * bound * (1.0 + 1e-9)


def test_a_robot_that_is_slowed_by_its_limits_gets_more_time():
    half = Object((0, 0, 0), most=0.5 * SPEED)
    tracker, steps = follow(LINE, half)
    assert steps[-1].phase is PathPhase.REACHED
    assert len(steps) * PERIOD == pytest.approx(2.0 * LINE.duration, rel=0.15)
    assert tracker.max_position_error < 0.5 * tracker.settings.position_tolerance
    assert PathPhase.SLOWED in {tracking.phase for tracking in steps}


def test_an_object_off_the_path_ends_it_at_rest():
    for wrong in ((0.011, 0.0, 0.0), (0.0, 0.0, 0.21), (0.0, 0.0, -0.21)):
        tracker = PathTracker(LINE, TrackingSettings(), PERIOD)
        tracking = tracker.update(Pose(*wrong), 0.0, PERIOD)
        assert tracking.phase is PathPhase.OFF_PATH
        assert not tracking.twist.any()
        assert 'off the path' in tracking.message


def test_an_object_that_stays_off_the_end_is_off_the_path():
    # A drift of 0.55 tolerances times the gain leaves an error of as much.
    settings = TrackingSettings(position_gain=1.0, progress_timeout=1.0)
    drift = (0.0, 0.55 * settings.position_tolerance * settings.position_gain, 0.0)
    tracker, steps = follow(LINE, Object((0, 0, 0), drift=drift), settings)
    assert steps[-1].phase is PathPhase.OFF_PATH
    assert 'off the end of the path' in steps[-1].message
    assert steps[-2].phase is PathPhase.SETTLING
    assert tracker.clock.at_end


def test_errors_so_far_are_kept():
    tracker = PathTracker(LINE, TrackingSettings(), PERIOD)
    assert tracker.rms_position_error == 0.0
    errors = [0.001, 0.004, 0.002]
    for error in errors:
        tracker.update(Pose(0.0, error, -10.0 * error), 0.0, PERIOD, held=True)
    assert tracker.max_position_error == pytest.approx(0.004)
    assert tracker.max_angle_error == pytest.approx(0.04)
    assert tracker.rms_position_error == pytest.approx(math.sqrt(np.mean(np.square(errors))))


@robots.examples(40)
@given(
    st.integers(0, 2**32 - 1),
    st.floats(0.0, 0.15),
    st.integers(0, 20),
    st.floats(0.0, 3e-4),
    st.booleans(),
)
def test_reaches_the_end_of_any_path_within_tolerance(seed, slip, delay, noise, smooth):
    rng = np.random.default_rng(seed)
    poses = np.cumsum(rng.uniform(-0.05, 0.05, (4, 3)) * [1.0, 1.0, 10.0], axis=0)
    path = ObjectPath(poses, rng.uniform(0.01, 0.05), rng.uniform(0.1, 0.4), smooth)
    tracker, steps = follow(path, Object(poses[0], slip, delay, noise=noise))
    assert steps[-1].phase is PathPhase.REACHED
    assert tracker.max_position_error < tracker.settings.position_tolerance
    for tracking in steps:
        speed = math.hypot(*tracking.twist[:2])
        assert speed <= 1.5 * path.speed * (1.0 + 1e-9)
        assert abs(tracking.twist[2]) <= 1.5 * path.turn_rate * (1.0 + 1e-9)


@pytest.mark.parametrize('frequency', [0.5, 1.0])
@pytest.mark.parametrize('speeds', [(0.02, 0.01), (0.001, 0.2)])
def test_ramps_keep_deviations_by_inertia_within_half_of_the_tolerances(speeds, frequency):
    settings, line = TrackingSettings(), [(0.0, 0.0, 0.0), (0.2, 0.0, 0.0)]
    tracker = PathTracker(ObjectPath(line, *speeds), settings, PERIOD)
    tracker.allow_for_inertia(frequency)
    # A step of the acceleration displaces an undamped object by twice the static displacement.
    deviations = 2.0 * np.array(speeds) / tracker.clock.ramp_time / frequency**2
    shares = deviations / (settings.position_tolerance, settings.angle_tolerance)
    assert 0.3 < shares.max() <= 0.5


def test_limits_slow_path_time_along_the_ramp_to_a_tenth_and_a_lag_at_once():
    moving, rates = PathClock(100.0, 0.5, 1.0, PERIOD), []
    moving.rate = 1.0
    for _ in range(200):
        moving.advance(PERIOD, 1.0, 0.5, False)
        rates.append(moving.rate)
    assert rates[0] == pytest.approx(1.0 - PERIOD / 0.5)
    assert rates[-1] == pytest.approx(0.1)
    moving.advance(PERIOD, 0.03, 1.0, False)
    assert moving.rate == 0.03


def test_path_time_at_less_than_a_hundredth_of_its_rate_is_no_progress():
    moving = PathClock(100.0, 0.5, 1.0, PERIOD)
    for _ in range(120):
        moving.advance(PERIOD, 0.005, 1.0, False)
    assert moving.waited == pytest.approx(120 * PERIOD)


def test_a_starved_loop_advances_by_two_cycles_at_most():
    moving = PathClock(10.0, 0.5, 1.0, PERIOD)
    assert moving.advance(1.5 * PERIOD, 1.0, 1.0, False) == 1.5 * PERIOD
    assert moving.advance(9.0 * PERIOD, 1.0, 1.0, False) == pytest.approx(2.0 * PERIOD)


TIMEOUT = 0.2
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
