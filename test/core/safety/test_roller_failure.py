# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Detection of failed rollers in time, without false detections."""

from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.safety.roller_failure import FAILURE_TIME, FailureDetector
import numpy as np
import pytest
import robots

NAMES = ('a', 'b', 'c', 'd')
RATE = 200.0


class Rollers:
    """Rollers with delay, noise and slip, and their detector; `works`: shares of the command."""

    def __init__(self, delay=0.0, noise=0.0, slip=0.0, seed=0, time=FAILURE_TIME):
        self.detector = FailureDetector.of(NAMES, time)
        self.works = np.ones(len(NAMES))
        self.positions = np.zeros(len(NAMES))
        self._waiting = [np.zeros(len(NAMES))] * round(delay * RATE)
        self._noise, self._slip = noise, slip
        self._rng = np.random.default_rng(seed)

    def move(self, command):
        """Move for one period, and return what is measured then."""
        self._waiting.append(command)
        effect = self._waiting.pop(0) * self.works
        effect = effect * (1.0 + self._slip * self._rng.standard_normal(len(NAMES)))
        self.positions = self.positions + effect / RATE
        return self.positions + self._noise * self._rng.standard_normal(len(NAMES))

    def run(self, commands, start=100.0):
        """Return the time from the start at which each roller was detected [s]."""
        detected = {}
        for k, command in enumerate(commands):
            measured = self.move(np.asarray(command))
            self.detector = self.detector.updated(measured, start + k / RATE, np.asarray(command))
            for name in self.detector.failed - set(detected):
                detected[name] = k / RATE
        return detected


def steady(speeds, duration):
    return [np.asarray(speeds)] * round(duration * RATE)


@pytest.mark.parametrize('speed', [0.1, -0.1, 0.03])
@pytest.mark.parametrize('time', [0.5, 1.0, 3.0])
def test_a_stuck_roller_is_detected_after_its_failure_time(speed, time):
    rollers = Rollers(noise=1e-4, time=time)
    rollers.works[1] = 0.0
    detected = rollers.run(steady([speed] * 4, 5.0))
    assert set(detected) == {'b'}
    assert time <= detected['b'] <= time + 0.02


@robots.examples(40)
@given(robots.generators(), st.floats(0.1, 4.5))
def test_oscillating_commands_detect_stuck_rollers_alone(rng, frequency):
    """Over 2 mm or more, up to 5 Hz, among late and noisy ones."""
    rollers = Rollers(rng.uniform(0.0, 0.1), 2e-5, 0.2, int(rng.integers(1e9)))
    stuck = rng.random(4) < 0.5
    rollers.works[:] = np.where(stuck, 0.0, rng.uniform(0.6, 1.0, 4))
    size = np.maximum(rng.uniform(0.01, 0.1, 4), 0.0025 * np.pi * frequency)
    times = np.arange(8 * RATE)[:, None] / RATE
    phase = rng.uniform(0.0, 2.0 * np.pi, 4)
    commands = size * np.sin(2.0 * np.pi * frequency * times + phase)
    detected = rollers.run(commands)
    assert set(detected) == {name for name, is_stuck in zip(NAMES, stuck, strict=True) if is_stuck}
    # Speeds below 2 mm/s at the turns do not count.
    assert max(detected.values(), default=0.0) < 1.6


@robots.examples(40)
@given(robots.generators(), st.sampled_from(['steps', 'swing', 'slow swing', 'jumps', 'ramps']))
def test_rollers_that_follow_are_never_flagged(rng, kind):
    """Late by up to 0.1 s, noisy, slipping, at any command."""
    rollers = Rollers(rng.uniform(0.0, 0.1), rng.uniform(0.0, 5e-4), 0.2, int(rng.integers(1e9)))
    rollers.works[:] = rng.uniform(0.6, 1.0, 4)
    times = np.arange(10 * RATE)[:, None] / RATE
    if kind == 'steps':
        commands = np.repeat(rng.uniform(-0.1, 0.1, (20, 4)), round(0.5 * RATE), axis=0)
    elif kind == 'swing':
        commands = 0.1 * np.sin(2.0 * np.pi * rng.uniform(0.1, 10.0, 4) * times)
    elif kind == 'slow swing':
        size = rng.uniform(0.002, 0.02, 4)
        commands = size * np.sin(2.0 * np.pi * rng.uniform(0.05, 5.0, 4) * times)
    elif kind == 'jumps':
        pieces = rng.choice([0.0, 0.0021, -0.0021, 0.1, -0.1], (100, 4))
        commands = np.repeat(pieces, round(rng.uniform(0.01, 0.3) * RATE), axis=0)
    else:
        commands = 0.1 * np.clip(rng.standard_normal((len(times), 4)).cumsum(axis=0) / 20, -1, 1)
    assert rollers.run(commands) == {}


def test_a_roller_that_is_not_commanded_is_never_flagged():
    rollers = Rollers()
    rollers.works[:] = 0.0
    assert rollers.run(steady([0.0] * 4, 5.0)) == {}
    assert rollers.run(steady([0.0015] * 4, 10.0)) == {}
    trembling = [[0.1 * (-1.0) ** k] * 4 for k in range(1000)]
    assert rollers.run(trembling) == {}
    swing = 0.1 * np.sin(16.0 * np.pi * np.arange(5 * RATE) / RATE)  # faster than drives follow
    assert rollers.run([[speed] * 4 for speed in swing.tolist()]) == {}
    assert set(rollers.run(steady([0.1, 0.0, 0.0, 0.0], 5.0))) == {'a'}


def test_pauses_do_not_hide_a_stuck_roller():
    rollers = Rollers()
    rollers.works[0] = 0.0
    bursts = (steady([0.05, 0, 0, 0], 0.2) + steady([0.0] * 4, 0.5)) * 10
    detected = rollers.run(bursts)
    assert set(detected) == {'a'}
    assert 4 * 0.7 < detected['a'] < 5 * 0.7 + 0.2


def test_a_failed_roller_works_again_only_after_a_reset():
    rollers = Rollers()
    rollers.works[:2] = 0.0
    rollers.run(steady([0.05] * 4, 2.0))
    assert rollers.detector.failed == {'a', 'b'}
    rollers.works[:] = 1.0
    rollers.run(steady([0.0, 0.0, 0.05, 0.05], 5.0), start=102.0)
    # Moving, even by hand, is not enough.
    rollers.run(steady([0.05] * 4, 5.0), start=107.0)
    assert rollers.detector.failed == {'a', 'b'}
    rollers.detector = rollers.detector.reset(['a'])
    assert rollers.detector.failed == {'b'}
    rollers.detector = rollers.detector.reset()
    assert rollers.detector.failed == set()
    assert rollers.run(steady([0.05] * 4, 5.0), start=112.0) == {}
    rollers.works[3] = 0.0
    assert set(rollers.run(steady([0.05] * 4, 3.0), start=117.0)) == {'d'}
    with pytest.raises(GraspError, match="rollers 'z': the robot has no such rollers"):
        rollers.detector.reset(['z'])


@pytest.mark.parametrize(
    ('first', 'step'), [(100.0, 1.5), (1000.0, -0.01), (100.0, 0.0)], ids=['gaps', 'back', 'equal']
)
def test_samples_far_apart_or_out_of_order_flag_no_roller(first, step):
    rollers, command = Rollers(), np.full(4, 0.1)
    rollers.works[:] = 0.0
    for k in range(1000):
        measured = rollers.move(command)
        rollers.detector = rollers.detector.updated(measured, first + step * k, command)
    assert rollers.detector.failed == set()
    assert set(rollers.run(steady(command, 2.0), start=5.0)) == set(NAMES)


@pytest.mark.parametrize('speed', [0.0021, 0.0024])
def test_a_slow_roller_is_detected_a_settling_time_after_2_mm(speed):
    rollers = Rollers()
    rollers.works[1] = 0.0
    times = rollers.run(steady([speed] * 4, 3.0))
    assert times == {'b': pytest.approx(0.002 / speed + 0.2, abs=0.012)}


@pytest.mark.parametrize('works', [0.05, 0.55, 0.75, 0.95, 3.0])
def test_a_roller_that_fails_in_motion_is_detected_within_its_failure_time_and_20_mm(works):
    rollers = Rollers()
    assert rollers.run(steady([0.1] * 4, works)) == {}
    rollers.works[0] = 0.0
    times = rollers.run(steady([0.1] * 4, 3.0), start=100.0 + works)
    assert 0.8 <= times['a'] <= 1.0 + 0.02 / 0.1 + 0.01
