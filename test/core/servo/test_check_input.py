# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Inputs of a servo that are checked, and texts of its decisions."""

import math

from isotruss_ros import core
from isotruss_ros.core import Status
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.estimation.state_estimate import EstimatedTravel, EstimatorSettings
from isotruss_ros.core.inputs import RejectedInput, RollerState, StampedInput
from isotruss_ros.core.manipulation.status import RollerCommand
from isotruss_ros.core.paths.path_tracking import TrackingSettings
from isotruss_ros.core.safety.shape_guard import ShapeBounds
from isotruss_ros.core.servo.decision import describe, describe_squeeze
from isotruss_ros.core.servo.servo_settings import ServoSettings, SqueezeSettings
import numpy as np
import pytest

ROBOT = core.load_robot('nine_member')
NONE = np.zeros(len(ROBOT.roller_names))
COUNT = len(NONE)
NAN = np.full(COUNT, math.nan)
#: Input, valid value, invalid values with a word of the reason.
INPUTS = [
    ('twist', (0.0, 0.1, 0.2), [((0.0, 0.1), 'twist'), ((0.0, 0.1, math.inf), 'twist')]),
    ('pose', core.Pose(0, 0.1, 0.2), [((0.0, 0.1, 0.2, 0.3), 'pose'), ((math.nan,) * 3, 'pose')]),
    ('wrench', (1.0, 2.0, 0.1), [((1.0, 2.0), 'wrench'), ((1e7, 0.0, 0.0), 'wrench')]),
    ('pressures', (3e4,) * 3, [((3e4,) * 2, 'pressure'), ((-1.0, 3e4, 3e4), 'pressure')]),
    (
        'rollers',
        RollerState(NONE, NONE, NONE),
        [
            (RollerState(NAN, NONE), 'positions of rollers'),
            (RollerState(NONE, NAN), 'velocities of rollers'),
            (RollerState(NONE, NONE, NAN), 'offsets of rollers'),
            (RollerState(NONE, NONE, math.nan), 'offsets of rollers'),
            (RollerState(NONE, NONE, None), 'offsets of rollers'),
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
GRIP = core.Grip(('north/P-Z', 'north/Z-R'), core.ConvexObject.disc((0.7, 0.8), 0.3))


def receive(name, value, time=1.0):
    """Return an input of a servo that has received a value."""
    servo = core.TwistServo(ROBOT, ServoSettings(GRIP, 0.01, 0.2))
    servo.receive(**{name: StampedInput(value, time)})
    return getattr(servo.inputs, name)


@pytest.mark.parametrize(('name', 'good', 'bad'), INPUTS)
def test_inputs_of_other_counts_or_ranges_are_rejected_with_their_name(name, good, bad):
    assert receive(name, good) == StampedInput(good, 1.0)
    for value, word in bad:
        rejected = receive(name, value)
        assert isinstance(rejected, RejectedInput)
        assert word in rejected.reason
    assert 'time of' in receive(name, good, math.nan).reason


#: Settings with values, each of which is out of its range.
WRONG_SETTINGS = [
    (ServoSettings, {'period': 10.0, 'timeout': 200.0, 'pressure_timeout': 0.0}),
    (ServoSettings, {'failure_time': -1.0, 'grip': None, 'squeeze': 15.0, 'bounds': {}}),
    (SqueezeSettings, {'force': -1e-9, 'load': 1e4, 'zero_deviation': 10.0, 'frequency': 0.0}),
    (SqueezeSettings, {'force': math.inf, 'pose_gain': math.inf, 'max_utilisation': 0.0}),
    (EstimatorSettings, dict.fromkeys(vars(EstimatorSettings()), 100.0) | {'load': -1.0}),
    (ShapeBounds, dict.fromkeys(vars(ShapeBounds()), -1.0)),
    (TrackingSettings, dict.fromkeys(vars(TrackingSettings()), -1.0)),
    (core.RollerFaults, {'slip': 0.6, 'noise': -1.0, 'speed_limit': -1.0}),
]
GOOD_SETTINGS = {ServoSettings: {'grip': GRIP, 'period': 0.01, 'timeout': 0.2}}
GOOD_SETTINGS[SqueezeSettings] = {'force': 15.0}


@pytest.mark.parametrize(
    ('kind', 'name', 'value'),
    [(kind, *wrong) for kind, values in WRONG_SETTINGS for wrong in values.items()],
)
def test_settings_out_of_range_are_refused_with_their_name_and_range(kind, name, value):
    for wrong in {value, math.nan, 'x'} if isinstance(value, float) else (value,):
        with pytest.raises(core.IsotrussError, match=f'{name}.*: must be '):
            kind(**GOOD_SETTINGS.get(kind, {}) | {name: wrong})


def test_an_inclination_in_degrees_is_refused_with_its_value_in_radians():
    with pytest.raises(ConfigurationError, match=r'if it is in degrees, it is 1\.571 rad'):
        EstimatorSettings(inclination=90.0)


CLOSEST = (
    'the twist is unreachable or would break contacts; '
    'the closest one that keeps the contacts is (0.01, 0.02) m/s, 0.3 rad/s'
)
ALONG = 'along (0.01, 0.02) m/s, 0.3 rad/s'


@pytest.mark.parametrize(
    ('status', 'scale', 'limiting', 'text'),
    [
        (Status.OK, 1.0, (), ''),
        (Status.SLOWED_BARRIER, 1.0, (), ''),
        (Status.HALT_NO_TWIST, 0.0, (), ''),
        (Status.SLOWED_OBJECT, 0.25, ('a', 'b'), 'slowed to 25 % by the limits of a, b'),
        (Status.HALT_NO_TWIST - 1, 0.25, ('a',), 'slowed to 25 % by the limits of a'),
        (Status.SLIDING, 0.25, ('a',), f'sliding with 25 %, {ALONG} by the limits of a'),
        (
            Status.SLIDING,
            6e-7,
            ('a',),
            f'sliding with less than 1 %, {ALONG} by the limits of a',
        ),
        (Status.UNREACHABLE, 1.0, (), CLOSEST),
        (Status.UNREACHABLE, 0.5, ('a',), f'{CLOSEST}; slowed to 50 % by the limits of a'),
    ],
)
def test_message_names_the_closest_twist_and_the_remaining_share(status, scale, limiting, text):
    command = RollerCommand(np.ones(6), np.array([0.01, 0.02, 0.3]), scale, status, limiting)
    assert describe(command, True) == text
    if text.startswith(CLOSEST):  # a joint has no contacts
        assert describe(command, False).startswith('the twist is unreachable; the closest reach')


def test_a_squeeze_with_a_deviation_above_its_half_is_unknown():
    assert describe_squeeze(10.0, 5.0) == 'squeeze 10.0 N, deviation 5.0 N'
    assert describe_squeeze(10.0, 5.1).startswith('squeeze unknown: 10.0 N, deviation 5.1 N; ')
