# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Failed rollers are found in time; rollers that work or are not commanded are not flagged."""

from hypothesis import given, strategies
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.safety.roller_failure import FailureDetector
import numpy as np
import pytest
import robots

NAMES = ('a', 'b', 'c', 'd')
RATE = 200.0


class Rollers:
    """
    Rollers that follow commands late, badly or not at all, and sensors that are no better.

    :ivar works: share of the command that each roller does.
    """

    def __init__(self, delay=0.0, noise=0.0, slip=0.0, seed=0):
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


def run(detector, rollers, commands, start=100.0):
    """Feed a detector; return when each roller was found to have failed, from the start on."""
    found = {}
    for k, command in enumerate(commands):
        measured = rollers.move(np.asarray(command))
        detector.update(measured, start + k / RATE, np.asarray(command))
        for name in detector.failed - set(found):
            found[name] = k / RATE
    return found


def steady(speeds, duration):
    return [np.asarray(speeds)] * round(duration * RATE)


def detector(**options):
    return FailureDetector(NAMES, **options)


@pytest.mark.parametrize('speed', [0.1, -0.1, 0.03])
@pytest.mark.parametrize('time', [0.5, 1.0, 3.0])
def test_stuck_roller_is_found_in_the_stated_time(speed, time):
    rollers = Rollers()
    rollers.works[1] = 0.0
    found = run(detector(failure_time=time), rollers, steady([speed] * 4, 5.0))
    assert set(found) == {'b'}
    assert time <= found['b'] <= time + 0.02


@robots.examples(40)
@given(robots.generators(), strategies.floats(0.1, 4.5))
def test_swinging_commands_find_who_is_stuck_and_no_other(rng, frequency):
    """Over 2 mm or more, up to 5 Hz, among late and noisy ones."""
    rollers = Rollers(rng.uniform(0.0, 0.1), 2e-5, 0.2, int(rng.integers(1e9)))
    stuck = rng.random(4) < 0.5
    rollers.works[:] = np.where(stuck, 0.0, rng.uniform(0.6, 1.0, 4))
    size = np.maximum(rng.uniform(0.01, 0.1, 4), 0.0025 * np.pi * frequency)
    times = np.arange(8 * RATE)[:, None] / RATE
    phase = rng.uniform(0.0, 2.0 * np.pi, 4)
    commands = size * np.sin(2.0 * np.pi * frequency * times + phase)
    found = run(detector(), rollers, commands)
    assert set(found) == {name for name, is_stuck in zip(NAMES, stuck, strict=True) if is_stuck}
    # Speeds below 2 mm/s at the turns do not count.
    assert max(found.values(), default=0.0) < 1.6


def test_roller_that_fails_on_the_way_is_found():
    rollers, watched = Rollers(noise=1e-4), detector()
    assert run(watched, rollers, steady([0.05] * 4, 3.0)) == {}
    rollers.works[2] = 0.0
    found = run(watched, rollers, steady([0.05] * 4, 3.0), start=103.0)
    assert set(found) == {'c'}
    # What it did before it failed holds it up for no longer than min_travel takes.
    assert found['c'] <= 1.0 + 2 * 0.02 / 0.05


@robots.examples(40)
@given(
    robots.generators(),
    strategies.sampled_from(['steps', 'swing', 'slow swing', 'jumps', 'ramps']),
)
def test_rollers_that_follow_are_never_flagged(rng, kind):
    """Late by up to 0.1 s, noisy, slipping, at any command."""
    rollers = Rollers(rng.uniform(0.0, 0.1), rng.uniform(0.0, 5e-4), 0.2, int(rng.integers(1e9)))
    rollers.works[:] = rng.uniform(0.6, 1.0, 4)
    times = np.arange(20 * RATE)[:, None] / RATE
    if kind == 'steps':
        commands = np.repeat(rng.uniform(-0.1, 0.1, (40, 4)), round(0.5 * RATE), axis=0)
    elif kind == 'swing':
        commands = 0.1 * np.sin(2.0 * np.pi * rng.uniform(0.1, 10.0, 4) * times)
    elif kind == 'slow swing':
        size = rng.uniform(0.002, 0.02, 4)
        commands = size * np.sin(2.0 * np.pi * rng.uniform(0.05, 5.0, 4) * times)
    elif kind == 'jumps':
        # Barely commanded, and at full speed now and then, for a while that may be short.
        pieces = rng.choice([0.0, 0.0021, -0.0021, 0.1, -0.1], (200, 4))
        commands = np.repeat(pieces, round(rng.uniform(0.01, 0.3) * RATE), axis=0)
    else:
        commands = 0.1 * np.clip(
            np.cumsum(rng.standard_normal((len(times), 4)), axis=0) / 20, -1, 1
        )
    assert run(detector(), rollers, commands) == {}


def test_a_roller_that_is_not_commanded_is_never_flagged():
    rollers = Rollers()
    rollers.works[:] = 0.0
    assert run(detector(), rollers, steady([0.0] * 4, 5.0)) == {}
    # Nor who is asked for less than friction lets through, nor who trembles in place.
    assert run(detector(), rollers, steady([0.0015] * 4, 20.0)) == {}
    trembling = [[0.1 * (-1.0) ** k] * 4 for k in range(1000)]
    assert run(detector(), rollers, trembling) == {}
    # Others do not make up for it.
    assert set(run(detector(), rollers, steady([0.1, 0.0, 0.0, 0.0], 5.0))) == {'a'}


def test_pauses_do_not_help():
    rollers, watched = Rollers(), detector()
    rollers.works[0] = 0.0
    bursts = (steady([0.05, 0, 0, 0], 0.2) + steady([0.0] * 4, 0.5)) * 10
    found = run(watched, rollers, bursts)
    assert set(found) == {'a'}
    assert 4 * 0.7 < found['a'] < 5 * 0.7 + 0.2


def test_only_somebody_who_says_so_makes_a_roller_work_again():
    rollers, watched = Rollers(), detector()
    rollers.works[:2] = 0.0
    run(watched, rollers, steady([0.05] * 4, 2.0))
    assert watched.failed == {'a', 'b'}
    rollers.works[:] = 1.0
    run(watched, rollers, steady([0.0, 0.0, 0.05, 0.05], 5.0), start=102.0)
    # Moving, even by hand, is not enough.
    run(watched, rollers, steady([0.05] * 4, 5.0), start=107.0)
    assert watched.failed == {'a', 'b'}
    watched.reset(['a'])
    assert watched.failed == {'b'}
    watched.reset()
    assert watched.failed == set()
    assert run(watched, rollers, steady([0.05] * 4, 5.0), start=112.0) == {}
    rollers.works[3] = 0.0
    assert set(run(watched, rollers, steady([0.05] * 4, 3.0), start=117.0)) == {'d'}
    with pytest.raises(GraspError, match="rollers 'z': the robot has no such rollers"):
        watched.reset(['z'])


def test_gaps_and_clocks_that_run_back_say_nothing():
    rollers, watched = Rollers(), detector()
    rollers.works[:] = 0.0
    command = np.full(4, 0.1)
    for k in range(100):
        watched.update(rollers.move(command), 100.0 + 1.5 * k, command)  # too far apart
    assert watched.failed == set()
    for k in range(2000):
        watched.update(rollers.move(command), 1000.0 - 0.01 * k, command)
    assert watched.failed == set()
    for _ in range(2000):
        watched.update(rollers.move(command), 0.0, command)  # the same sample again and again
    assert watched.failed == set()
    assert set(run(watched, rollers, steady(command, 2.0), start=5.0)) == set(NAMES)


FAST = 1000.0


def found_at(speeds, moves=lambda _time: 0.0, rate=FAST, seconds=5.0):
    """
    Return when one roller is found to have failed by the default criterion; None if it is not.

    :param speeds: commanded speed by time.
    :param moves: share of it that the roller does, by time.
    """
    watched, position = FailureDetector(('a',)), 0.0
    for k in range(round(seconds * rate) + 1):
        # Half a cycle later than its end, where no command begins.
        time = (k - 0.5) / rate
        command = speeds(time) if k else 0.0
        position += command * moves(time) / rate
        watched.update(np.array([position]), 10.0 + k / rate, np.array([command]))
        if watched.failed:
            return k / rate
    return None


@pytest.mark.parametrize('speed', [0.0021, 0.0022, 0.0024])
def test_a_slow_roller_is_found_when_it_had_time_to_settle_after_2_mm(speed):
    found = found_at(lambda _time: speed, rate=4.0 * FAST)
    assert found == pytest.approx(0.002 / speed + 0.2, abs=0.0012)


@pytest.mark.parametrize('works', [0.05, 0.55, 0.75, 0.95])
def test_a_roller_that_fails_in_motion_is_found_within_its_failure_time_and_20_mm(works):
    rollers, watched = Rollers(), detector()
    assert run(watched, rollers, steady([0.1] * 4, works)) == {}
    rollers.works[0] = 0.0
    found = run(watched, rollers, steady([0.1] * 4, 3.0), start=100.0 + works)
    assert 0.8 <= found['a'] <= 1.0 + 0.02 / 0.1 + 0.01


@pytest.mark.parametrize(('frequency', 'flagged'), [(2.0, True), (10.0, False)])
def test_no_roller_has_to_follow_oscillations_faster_than_its_settling_time(frequency, flagged):
    rollers = Rollers()
    rollers.works[:] = 0.0
    phase = 2.0 * np.pi * frequency * np.arange(4 * RATE)[:, None] / RATE
    # By 3 mm or more, forth and back.
    assert bool(run(detector(), rollers, 0.1 * np.sin(phase) * np.ones(4))) is flagged


def test_a_sample_of_an_earlier_time_restarts_the_comparison():
    rollers, watched = Rollers(), detector()
    rollers.works[:] = 0.0
    assert run(watched, rollers, steady([0.1] * 4, 0.9)) == {}
    found = run(watched, rollers, steady([0.1] * 4, 3.0), start=100.5)
    assert set(found) == set(NAMES)
    assert min(found.values()) >= 1.0


def test_only_time_under_a_command_counts():
    rollers, judge = Rollers(), detector(failure_time=1.0)
    rollers.works[1] = 0.0
    assert not run(judge, rollers, steady([0.1] * 4, 0.9) + steady([0.0] * 4, 0.5))
    assert set(run(judge, rollers, steady([0.1] * 4, 0.2), 101.4)) == {'b'}
