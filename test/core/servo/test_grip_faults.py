# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of a grip that follow from a belief after a new pose."""

from types import SimpleNamespace

from isotruss_ros.core import Status
from isotruss_ros.core.estimation.contact_walk import PoseNoise
from isotruss_ros.core.servo.servo_settings import SqueezeSettings
from isotruss_ros.core.servo.squeeze_control import SqueezeControl
from isotruss_ros.core.servo.swing_watch import SwingWatch
import numpy as np
import pytest

ARM, STILL, PERIOD = 0.1, np.zeros(3), 0.02


def faults():
    """Return the faults of a grip that has none."""
    control = SqueezeControl(SqueezeSettings(10.0))
    control.swings, control.gain = SwingWatch(12.0), 3.0
    return control


def belief(correction=0.0, walked=0.0, jump=0.0, slipped=False):
    """Return a belief of a grip with a correction of the pose along x [m]."""
    state = SimpleNamespace(
        noise=PoseNoise(np.zeros(3)), walk=SimpleNamespace(length=walked), jump=jump
    )
    return SimpleNamespace(
        correction=np.array([correction, 0.0, 0.0]),
        state=state,
        scale=np.array([1.0, 1.0, ARM]),
        slipped=slipped,
    )


def shake(grip, duration, size=0.01, velocity=STILL):
    """Shake the object at 12 rad/s; return the time of the first oscillation [s], or None."""
    for number in range(round(duration / PERIOD)):
        away = size * np.sin(12.0 * number * PERIOD)
        grip.judge(belief(away), PERIOD, velocity)
        if grip.fault is Status.HALT_OSCILLATES:
            return number * PERIOD
    return None


def test_an_oscillation_is_a_fault_for_one_second_and_halves_the_gain_each_time():
    grip = faults()
    for gain in (0.5, 0.25):
        assert shake(grip, 2.0) is not None
        assert grip.softening == gain
        assert grip.note() == 'the object oscillates: the pose gain is reduced to 3 1/s'
        for _ in range(49):
            grip.judge(belief(), PERIOD, STILL)
            assert grip.fault is Status.HALT_OSCILLATES
        grip.judge(belief(), PERIOD, STILL)
        assert grip.fault is None


def test_an_oscillation_ends_after_exactly_one_second():
    grip = faults()
    assert shake(grip, 2.0) is not None
    for number in range(4):
        assert grip.fault is Status.HALT_OSCILLATES, number
        grip.judge(belief(), 0.25, STILL)
    assert grip.fault is None


def test_an_oscillation_is_detected_anew_after_its_rest():
    grip = faults()
    assert shake(grip, 2.0) is not None
    for number in range(60):
        grip.judge(belief(0.01 * np.sin(12.0 * number * PERIOD)), PERIOD, STILL)
    assert grip.fault is None


@pytest.mark.parametrize('velocity', [(0.2, 0.0, 0.0), (0.0, -0.2, 0.0), (0.0, 0.0, 0.2 / ARM)])
def test_a_swing_within_a_quarter_of_the_commanded_travel_is_no_oscillation(velocity):
    # Behind the filter a half period of 0.26 s has swings of 14 mm, and 52 mm of travel.
    assert shake(faults(), 3.0, velocity=np.array(velocity)) is None
    assert shake(faults(), 3.0, velocity=0.6 * np.array(velocity)) is not None


def test_a_slip_that_a_belief_states_is_a_fault_with_its_cause_and_next_step():
    grip = faults()
    grip.judge(belief(walked=0.0123, slipped=True), PERIOD, STILL)
    assert grip.fault is Status.HALT_SLIPPED
    assert grip.note() == (
        'the object moved by 12 mm against the members; '
        'next step: resume the grip (service resume_grip)'
    )


@pytest.mark.parametrize(
    ('jump', 'fault'), [(0.019, None), (0.02, None), (0.021, Status.HALT_NOT_HELD)]
)
def test_a_jump_by_more_than_20_mm_is_a_loss(jump, fault):
    grip = faults()
    grip.judge(belief(walked=jump, jump=jump), PERIOD, STILL)
    assert grip.fault is fault


def test_a_loss_outranks_a_slip_and_the_first_fault_remains():
    grip = faults()
    grip.judge(belief(walked=0.03, jump=0.03, slipped=True), PERIOD, STILL)
    assert grip.fault is Status.HALT_NOT_HELD
    note = grip.note()
    grip.judge(belief(walked=0.04, slipped=True), PERIOD, STILL)
    assert (grip.fault, grip.note()) == (Status.HALT_NOT_HELD, note)
    grip.acknowledge()
    assert grip.fault is None
    assert grip.softening == 1.0


def test_a_loss_during_an_oscillation_is_a_fault():
    grip = faults()
    assert shake(grip, 2.0) is not None
    grip.judge(belief(walked=0.03, jump=0.03), PERIOD, STILL)
    for _ in range(100):
        grip.judge(belief(), PERIOD, STILL)
    assert grip.fault is Status.HALT_NOT_HELD


def test_a_short_slip_is_noted_until_half_of_it_is_undone():
    grip = faults()
    grip.judge(belief(), PERIOD, STILL)
    assert grip.note() == ''
    grip.judge(belief(walked=0.008, jump=0.007), PERIOD, STILL)
    assert grip.note() == 'slipped by 8 mm, held'
    for walked in (0.006, 0.004):
        grip.judge(belief(walked=walked), PERIOD, STILL)
        assert grip.note() == 'slipped by 8 mm, held'
    grip.judge(belief(walked=0.0039), PERIOD, STILL)
    assert grip.note() == ''
    assert grip.fault is None


def test_slips_are_noted_in_millimetres():
    grip = faults()
    grip.judge(belief(walked=0.6, jump=0.001), PERIOD, STILL)
    assert grip.note() == 'slipped by 600 mm, held'
    grip.judge(belief(walked=0.6, slipped=True), PERIOD, STILL)
    assert grip.note().startswith('the object moved by 600 mm')


def test_an_unknown_squeeze_is_noted_with_a_slip():
    grip = faults()
    assert grip.note((10.0, 4.9)) == ''
    grip.slipped = 0.008
    assert grip.note((10.0, 5.1)).startswith('slipped by 8 mm, held; held, squeeze unknown: 10.')
