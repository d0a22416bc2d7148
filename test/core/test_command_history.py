# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Travel of past commands, against numerical integration, and interpolation in time."""

from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros.core.inputs import CommandHistory, RollerState, StampedInput, Timeline
import numpy as np
import pytest
import robots

COUNT = 3
STEP = 1e-4


def by_steps(times, speeds, before, begin, end):
    """Integrate by small steps."""
    middles = np.arange(begin + 0.5 * STEP, end, STEP)
    place = np.searchsorted(times, middles, side='right') - 1
    rates = np.where((place < 0)[:, None], before, np.asarray(speeds)[place])
    return STEP * rates.sum(axis=0)


@robots.examples(50)
@given(robots.generators())
def test_travel_is_the_integral_of_the_commands(rng):
    times = 100.0 + STEP * np.sort(rng.integers(0, 5000, 60))
    speeds, before = rng.uniform(-0.1, 0.1, (60, COUNT)), rng.uniform(-0.1, 0.1, COUNT)
    sent = CommandHistory(COUNT)
    for time, speed in zip(times, speeds, strict=True):
        sent = sent.recorded(time, speed)
    begin, end = np.sort(99.8 + STEP * rng.integers(0, 9000, 2))
    expected = by_steps(times, speeds, before, begin, end)
    assert sent.travel(begin, end, before) == pytest.approx(expected, abs=1e-4)
    assert sent.travel(end, begin, before) == pytest.approx(-expected, abs=1e-4)
    assert (sent.last == speeds[-1]).all()


@pytest.mark.parametrize('now', [9.9, 10.9])
def test_commands_are_discarded_after_a_gap_or_a_clock_set_back(now):
    sent = CommandHistory(COUNT).recorded(10.0, np.ones(COUNT)).recent(10.5, 0.5)
    assert sent.travel(10.0, 10.5, np.zeros(COUNT)) == pytest.approx(0.5)
    sent = sent.recent(now, 0.5)
    assert sent.last is None
    assert not sent.travel(9.0, 11.0, np.zeros(COUNT)).any()


@robots.examples(20)
@given(robots.generators())
def test_expected_travel_is_the_integral_of_commands_of_rollers_that_follow_them(rng):
    times = 100.0 + STEP * np.sort(rng.integers(0, 5000, 20))
    speeds, measured = rng.uniform(-0.1, 0.1, (20, COUNT)), rng.uniform(-0.1, 0.1, COUNT)
    still = np.array([False, True, False])
    history = CommandHistory(COUNT)
    for time, speed in zip(times, speeds, strict=True):
        history = history.recorded(time, speed)
    begin, then, now = np.sort(99.9 + STEP * rng.integers(0, 8000, 3))
    rollers = StampedInput(RollerState(np.zeros(COUNT), measured), begin)
    travels = history.expected_travel(rollers, then, now, 0.03, still)
    following = np.where(still, 0.0, 1.0)
    before, travel = (following * by_steps(times, speeds, measured, begin, t) for t in (then, now))
    last = following * speeds[-1]
    for travelled, expected in zip(travels, (before, travel + 0.03 * last, last), strict=True):
        assert travelled == pytest.approx(expected, abs=1e-4)


@given(
    st.lists(st.tuples(st.floats(0.0, 1.0), st.floats(-1.0, 1.0)), min_size=1, max_size=12),
    st.lists(st.floats(-0.5, 1.5), min_size=1, max_size=4),
    st.floats(0.0, 1.0),
)
def test_a_timeline_agrees_with_linear_interpolation(values, times, start):
    timeline, stored = Timeline(), []
    for time, value in values:
        timeline = timeline.added(time, value)
        stored = [*(pair for pair in stored if pair[0] < time), (time, value)]
    timeline = timeline.since(start)

    for time in (t for t in times if t >= start):
        expected = np.interp(time, *np.transpose(stored))
        assert timeline.at(time) == pytest.approx(expected, abs=1e-9)
