# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rule for stamps, repeated readings and measured pressures."""

from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros.core.inputs import (
    check_stamp,
    CLOCK_SKEW,
    find_fresh,
    fresh_pressures,
    InputError,
    InputFault,
    PRESSURE_TIMEOUT,
    RejectedInput,
    StampedInput,
    steady_pressures,
    UsedReadings,
)
import pytest

NOW, TIMEOUT = 100.0, 0.2
NEW, LATE = StampedInput('new', NOW), StampedInput('late', NOW - 0.1)
BAD = RejectedInput('bad')


@given(st.floats(-1.0, 1.0))
def test_a_stamp_counts_from_the_largest_age_to_the_skew(ahead):
    stamp = NOW + ahead
    age = NOW - stamp
    if -CLOCK_SKEW <= age <= TIMEOUT:
        assert check_stamp('object_pose', stamp, NOW, TIMEOUT) == min(stamp, NOW)
        return
    with pytest.raises(InputError, match='object pose: ') as caught:
        check_stamp('object_pose', stamp, NOW, TIMEOUT)
    assert caught.value.fault is (InputFault.STALE if age > 0.0 else InputFault.INVALID)
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
    used, is_first = UsedReadings().use('pose', NOW, (1.0, 2.0))
    assert is_first
    assert used.use('pose', NOW + age, value)[1] is is_new
    assert used.use('markers', NOW, (1.0, 2.0))[1]


@pytest.mark.parametrize('change', [-0.019, 0.019, -0.021, 0.021])
def test_a_change_of_a_pressure_by_less_than_two_percent_is_noise(change):
    kept = (25e3, 30e3, 35e3)
    measured = (25e3, 30e3 * (1.0 + change), 35e3)
    assert steady_pressures(kept, measured) is (kept if abs(change) < 0.02 else measured)


def test_pressures_of_the_robot_file_and_measured_ones_replace_each_other():
    assert steady_pressures(None, (25e3,)) == (25e3,)
    assert steady_pressures((25e3,), None) is None


@pytest.mark.parametrize('age', [1.99, 2.01])
def test_pressures_are_valid_for_two_seconds(age):
    pressures = StampedInput((25e3,), NOW)
    if age < 2.0:
        assert fresh_pressures(NOW + age, PRESSURE_TIMEOUT, pressures) == (25e3,)
    else:
        with pytest.raises(InputError, match='pressure_timeout'):
            fresh_pressures(NOW + age, PRESSURE_TIMEOUT, pressures)


@pytest.mark.parametrize(
    ('kept', 'value'), [(None, None), (BAD, None), (LATE, 'late'), (NEW._replace(time=0.0), None)]
)
def test_only_a_fresh_input_has_a_value(kept, value):
    assert find_fresh(NOW, TIMEOUT, kept) == value
