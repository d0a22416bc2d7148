# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The clock of a path against the motion that it describes: ramps, brakes, progress."""

from isotruss_ros.core.paths.path_tracking import PathClock
import numpy as np
import pytest

RAMP, PERIOD = 0.5, 0.005


def clock(duration=10.0, time=0.0, rate=0.0, ramp=RAMP, progress_timeout=1.0):
    """Return a clock under way."""
    made = PathClock(duration, ramp, progress_timeout, PERIOD)
    made.time, made.rate = time, rate
    return made


def duration_of_the_rest(left, rate, ramp):
    """Return the integral of dx / v(x); v rises and falls by 1 / ramp, at most to 1."""
    middle = 0.5 * left
    u = np.linspace(0.0, np.sqrt(middle), 20_001)
    u = 0.5 * (u[1:] + u[:-1])  # x = u^2 from either end, where v may be 0

    def speed(x):
        rising = np.sqrt(rate**2 + 2.0 * x / ramp)
        return np.minimum(np.minimum(rising, 1.0), np.sqrt(2.0 * (left - x) / ramp))

    slowness = 2.0 * u / speed(u**2) + 2.0 * u / speed(left - u**2)
    return slowness.mean() * np.sqrt(middle)


@pytest.mark.parametrize('rate', [0.0, 0.3, 0.6, 1.0])
@pytest.mark.parametrize('left', [0.41, 0.5, 1.0, 4.0])
@pytest.mark.parametrize('ramp', [0.5, 0.8])
def test_time_left_is_that_of_the_quickest_motion(left, rate, ramp):
    found = clock(10.0, 10.0 - left, rate, ramp).time_left
    assert found == pytest.approx(duration_of_the_rest(left, rate, ramp), rel=1e-4)


def test_it_starts_and_ends_by_the_ramp():
    moving = clock(2.0)
    rates, times = [], []
    for _ in range(1000):
        moving.advance(PERIOD, 1.0, 1.0, False)
        rates.append(moving.rate)
        times.append(moving.time)
    starting = round(RAMP / PERIOD)
    expected = [(k + 1) * PERIOD / RAMP for k in range(starting)]
    assert rates[:starting] == pytest.approx(expected, rel=1e-9)
    assert max(rates) == 1.0
    # Torricelli: what is left is what braking takes.
    braking = [k for k in range(1, 1000) if times[k] < 2.0 and times[k - 1] > 2.0 - 0.4 * RAMP]
    assert len(braking) > 50
    for k in braking:
        assert rates[k] == pytest.approx((2.0 * (2.0 - times[k - 1]) / RAMP) ** 0.5, rel=1e-9)


def test_limits_of_the_robot_slow_it_at_the_pace_of_the_ramp_to_a_tenth():
    moving = clock(100.0, 1.0, 1.0)
    rates = []
    for _ in range(300):
        moving.advance(PERIOD, 1.0, 0.0, False)
        rates.append(moving.rate)
    assert rates[0] == pytest.approx(1.0 - PERIOD / RAMP)
    assert rates[-1] == pytest.approx(0.1, rel=1e-12)
    moving.advance(PERIOD, 0.03, 1.0, False)
    assert moving.rate == 0.03  # the lag of the robot is obeyed at once
    moving.advance(PERIOD, 1.0, 1.0, True)
    assert moving.rate == 0.0


@pytest.mark.parametrize(('room', 'progresses'), [(0.0099, False), (0.0101, True)])
def test_path_time_at_less_than_a_hundredth_of_full_rate_is_no_progress(room, progresses):
    moving = clock(1000.0, 0.0, room, progress_timeout=20.0)
    waited = []
    for _ in range(round(60.0 / PERIOD)):
        moving.advance(PERIOD, room, 1.0, False)
        waited.append(moving.waited)
    # What makes no progress in the timeout is over it: progress at any pace starts it again.
    assert (max(waited) < 20.0) is progresses


def test_a_starved_loop_advances_by_two_cycles_at_most():
    moving = clock()
    assert moving.advance(1.5 * PERIOD, 1.0, 1.0, False) == 1.5 * PERIOD
    assert moving.advance(9.0 * PERIOD, 1.0, 1.0, False) == pytest.approx(2.0 * PERIOD)
