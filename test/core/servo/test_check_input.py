# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Inputs of a servo that are checked, and those that are not numbers."""

import math

from isotruss_ros.core import load_robot, Pose
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.estimation.state_estimate import EstimatedTravel
from isotruss_ros.core.inputs import RejectedInput, RollerState, StampedInput
from isotruss_ros.core.numerics.arrays import MAX_MAGNITUDE
from isotruss_ros.core.servo.servo_settings import ServoSettings, SqueezeSettings
from isotruss_ros.core.servo.servo_state import check_input
import numpy as np
import pytest

ROBOT = load_robot('nine_member')
NONE = np.zeros(len(ROBOT.roller_names))


@pytest.mark.parametrize('name', ['grasp', 'held_grip', 'servo_feedback', 'markers'])
def test_inputs_without_numbers_are_taken_as_they_are(name):
    given = StampedInput(object(), 1.0)
    assert check_input(ROBOT, name, given) is given


@pytest.mark.parametrize('field', RollerState._fields)
def test_each_field_of_a_roller_state_is_checked(field):
    good = RollerState(NONE, NONE, NONE)
    assert check_input(ROBOT, 'rollers', StampedInput(good, 1.0)).value is good
    bad = good._replace(**{field: np.full(len(NONE), math.nan)})
    found = check_input(ROBOT, 'rollers', StampedInput(bad, 1.0))
    assert isinstance(found, RejectedInput)
    assert field in found.reason


COUNT = len(NONE)
#: Input, valid value, invalid values with a word of the reason.
INPUTS = [
    ('twist', (0.0, 0.1, 0.2), [((0.0, 0.1), 'twist'), ((0.0, 0.1, math.inf), 'twist')]),
    ('pose', Pose(0.0, 0.1, 0.2), [((0.0, 0.1, 0.2, 0.3), 'pose'), ((math.nan,) * 3, 'pose')]),
    ('wrench', (1.0, 2.0, 0.1), [((1.0, 2.0), 'wrench'), ((1e7, 0.0, 0.0), 'wrench')]),
    ('pressures', (3e4,) * 3, [((3e4,) * 2, 'pressure'), ((-1.0, 3e4, 3e4), 'pressure')]),
    (
        'rollers',
        RollerState(NONE, NONE),
        [
            (RollerState(NONE[1:], NONE), 'positions of rollers'),
            (RollerState(NONE, NONE[1:]), 'velocities of rollers'),
        ],
    ),
    (
        'estimate',
        EstimatedTravel(NONE, np.eye(COUNT)),
        [
            (EstimatedTravel(NONE[1:], np.eye(COUNT)), 'estimated roller offsets'),
            (EstimatedTravel(NONE, -np.eye(COUNT)), 'covariance of roller offsets'),
        ],
    ),
]


@pytest.mark.parametrize(('name', 'good', 'bad'), INPUTS)
def test_inputs_of_other_counts_or_ranges_are_rejected_with_their_name(name, good, bad):
    given = StampedInput(good, 1.0)
    assert check_input(ROBOT, name, given) is given
    for value, word in bad:
        rejected = check_input(ROBOT, name, StampedInput(value, 1.0))
        assert isinstance(rejected, RejectedInput)
        assert word in rejected.reason


@pytest.mark.parametrize('name', [name for name, *_ in INPUTS])
def test_times_must_be_finite(name):
    good = next(value for other, value, _ in INPUTS if other == name)
    rejected = check_input(ROBOT, name, StampedInput(good, math.nan))
    assert 'time of' in rejected.reason


@pytest.mark.parametrize('value', [0.0, -1.0, math.nan, 1e13])
@pytest.mark.parametrize('name', ['period', 'timeout', 'pressure_timeout', 'failure_time'])
def test_times_that_are_not_positive_are_refused(name, value):
    values = {'period': 0.01, 'timeout': 0.2} | {name: value}
    with pytest.raises(ConfigurationError, match=f'{name} .*: must be positive'):
        ServoSettings(None, **values)


@pytest.mark.parametrize('value', [-1e-9, math.nan, math.inf, 1.1e12])
@pytest.mark.parametrize('name', ['force', 'load', 'zero_deviation'])
def test_forces_and_deviations_may_be_zero_and_not_negative(name, value):
    assert getattr(SqueezeSettings(**{'force': 1.0} | {name: 0.0}), name) == 0.0
    with pytest.raises(ConfigurationError, match=f'{name} .*: must be zero or positive'):
        SqueezeSettings(**{'force': 1.0} | {name: value})


@pytest.mark.parametrize('name', ['pose_gain', 'frequency', 'max_utilisation'])
def test_gains_and_bounds_of_the_squeeze_are_positive(name):
    assert getattr(SqueezeSettings(1.0, **{name: MAX_MAGNITUDE}), name) == MAX_MAGNITUDE
    for value in (0.0, math.nan):
        with pytest.raises(ConfigurationError, match=f'{name} .*: must be positive'):
            SqueezeSettings(1.0, **{name: value})


@pytest.mark.parametrize('name', ['pose_gain', 'frequency'])
def test_only_a_utilisation_and_a_failure_time_may_be_infinite(name):
    assert SqueezeSettings(1.0, max_utilisation=math.inf).max_utilisation == math.inf
    assert ServoSettings(None, 0.01, 0.2, failure_time=math.inf).failure_time == math.inf
    with pytest.raises(ConfigurationError, match=name):
        SqueezeSettings(1.0, **{name: math.inf})
