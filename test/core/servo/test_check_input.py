# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Inputs of a servo that are checked, and those that are not numbers."""

import math

from isotruss_ros.core import load_robot
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.inputs import RejectedInput, RollerState, StampedInput
from isotruss_ros.core.servo.check_input import check_input
from isotruss_ros.core.servo.servo_settings import ServoSettings
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


@pytest.mark.parametrize('value', [0.0, -1.0, math.nan, 1e13])
@pytest.mark.parametrize('name', ['period', 'timeout', 'pressure_timeout', 'failure_time'])
def test_times_that_are_not_positive_are_refused(name, value):
    values = {'period': 0.01, 'timeout': 0.2} | {name: value}
    with pytest.raises(ConfigurationError, match=f'{name} .*: must be positive'):
        ServoSettings(None, **values)
