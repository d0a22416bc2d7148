# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stamps, repeated readings and measured pressures, and travel of past commands."""

from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros.core import inputs
import numpy as np
import pytest
import robots

NOW, TIMEOUT = 100.0, 0.2
NEW, LATE = inputs.StampedInput('new', NOW), inputs.StampedInput('late', NOW - 0.1)
BAD = inputs.RejectedInput('bad')


@given(st.floats(-1.0, 1.0))
def test_a_stamp_counts_from_the_largest_age_to_the_skew(ahead):
    stamp = NOW + ahead
    age = NOW - stamp
    if -inputs.CLOCK_SKEW <= age <= TIMEOUT:
        assert inputs.check_stamp('object_pose', stamp, NOW, TIMEOUT) == min(stamp, NOW)
        return
    with pytest.raises(inputs.InputError, match='object pose: ') as caught:
        inputs.check_stamp('object_pose', stamp, NOW, TIMEOUT)
    fault = inputs.InputFault.STALE if age > 0.0 else inputs.InputFault.INVALID
    assert caught.value.fault is fault
    assert f' {abs(age):.3f} s ' in str(caught.value)
    assert ('set it higher' in str(caught.value)) is (TIMEOUT < age < 3.0 * TIMEOUT)


@pytest.mark.parametrize(
    ('age', 'value', 'is_new'),
    [
        (0.01, (1.0, 3.0), True),
        (0.01, (1.0, 2.0), False),
        (0.0, (1.0, 2.0 + 1e-12), False),
        (-0.01, (1.0, 3.0), False),
        (-2.0, (1.0, 3.0), True),
    ],
    ids=['new', 'same value', 'same stamp', 'earlier stamp', 'clock set back'],
)
def test_a_new_measurement_has_a_later_stamp_and_another_value(age, value, is_new):
    used, is_first = inputs.UsedReadings().use('pose', NOW, (1.0, 2.0))
    assert is_first
    assert used.use('pose', NOW + age, value)[1] is is_new
    assert used.use('markers', NOW, (1.0, 2.0))[1]


@pytest.mark.parametrize('change', [-0.019, 0.019, -0.021, 0.021])
def test_a_change_of_a_pressure_by_less_than_two_percent_is_noise(change):
    kept = (25e3, 30e3, 35e3)
    measured = (25e3, 30e3 * (1.0 + change), 35e3)
    assert inputs.steady_pressures(kept, measured) is (kept if abs(change) < 0.02 else measured)


def test_pressures_of_the_robot_file_and_measured_ones_replace_each_other():
    assert inputs.steady_pressures(None, (25e3,)) == (25e3,)
    assert inputs.steady_pressures((25e3,), None) is None


@pytest.mark.parametrize('age', [1.99, 2.01])
def test_pressures_are_valid_for_two_seconds(age):
    pressures = inputs.StampedInput((25e3,), NOW)
    if age < 2.0:
        assert inputs.fresh_pressures(NOW + age, inputs.PRESSURE_TIMEOUT, pressures) == (25e3,)
    else:
        with pytest.raises(inputs.InputError, match='pressure_timeout'):
            inputs.fresh_pressures(NOW + age, inputs.PRESSURE_TIMEOUT, pressures)


@pytest.mark.parametrize(
    ('kept', 'value'), [(None, None), (BAD, None), (LATE, 'late'), (NEW._replace(time=0.0), None)]
)
def test_only_a_fresh_input_has_a_value(kept, value):
    assert inputs.find_fresh(NOW, TIMEOUT, kept) == value


COUNT = 3
STEP = 1e-4


def by_steps(times, speeds, before, begin, end):
    middles = np.arange(begin + 0.5 * STEP, end, STEP)
    place = np.searchsorted(times, middles, side='right') - 1
    rates = np.where((place < 0)[:, None], before, np.asarray(speeds)[place])
    return STEP * rates.sum(axis=0)


@pytest.mark.parametrize('now', [9.9, 10.9])
def test_commands_are_discarded_after_a_gap_or_a_clock_set_back(now):
    sent = inputs.CommandHistory(COUNT).recorded(10.0, np.ones(COUNT)).recent(10.5, 0.5)
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
    history = inputs.CommandHistory(COUNT)
    for time, speed in zip(times, speeds, strict=True):
        history = history.recorded(time, speed)
    begin, then, now = np.sort(99.9 + STEP * rng.integers(0, 8000, 3))
    rollers = inputs.StampedInput(inputs.RollerState(np.zeros(COUNT), measured), begin)
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
    timeline, stored = inputs.Timeline(), []
    for time, value in values:
        timeline = timeline.added(time, value)
        stored = [*(pair for pair in stored if pair[0] < time), (time, value)]
    timeline = timeline.since(start)

    for time in (t for t in times if t >= start):
        expected = np.interp(time, *np.transpose(stored))
        assert timeline.at(time) == pytest.approx(expected, abs=1e-9)
