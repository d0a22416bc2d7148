# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of a grip that the squeeze control detects from measured poses."""

from grips import gripped
from isotruss_ros.core import Grip, HoldStatus, Pose, Status
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.inputs import StampedInput
from isotruss_ros.core.servo.servo_settings import SqueezeSettings
from isotruss_ros.core.servo.squeeze_control import SqueezeControl
import numpy as np
import pytest

CONFIG, BODY = gripped(35.0, squeeze=0.1)
MODEL = attach_grip(CONFIG, BODY)
GRIP = Grip.at_module(CONFIG.robot, 'north/Z', MODEL.body)
PERIOD, FREQUENCY = 0.02, 12.0


class Hold:
    """Squeeze control of an object at rest, whose measured pose is displaced along y."""

    def __init__(self, load=0.0):
        """Start with an expected load [N]; 0: that of the estimator."""
        settings = SqueezeSettings(MODEL.squeeze, 4.0, frequency=FREQUENCY, load=load)
        self.control, self.time = SqueezeControl(settings), 0.0
        for number in range(6):
            self.measure(1e-5 * (-1) ** number)

    def measure(self, displacement, elapsed=PERIOD):
        """Measure the displaced pose [m]; return the fault of the grip."""
        self.time += elapsed
        pose = Pose(*np.add(MODEL.pose, (0.0, displacement, 0.0)))
        sample = StampedInput(pose, self.time), 0.0
        self.control.follow(
            CONFIG, GRIP, elapsed, sample, rollers=(MODEL.config.roller_positions, 0.0)
        )
        return self.control.fault

    def shake(self, duration, height=0.006):
        """Shake the object until an oscillation is detected; return whether it is."""
        for number in range(round(duration / PERIOD)):
            if self.measure(height * np.sin(FREQUENCY * number * PERIOD)) is not None:
                return True
        return False


def test_an_oscillation_halves_the_gain_and_is_a_fault_for_one_second():
    hold = Hold(load=40.0)
    for gain in (2.0, 1.0):
        assert hold.shake(2.5)
        assert hold.control.fault is Status.HALT_OSCILLATES
        # Without noise, the poses of an object at rest are equal.
        faults = [hold.measure(0.0) for _ in range(60)]
        assert faults.count(Status.HALT_OSCILLATES) in (49, 50)
        assert faults[-1] is None
        assert hold.control.gain == gain
    hold.control.acknowledge()
    hold.measure(0.0)
    assert hold.control.gain == 4.0


def test_the_note_of_an_oscillation_states_the_reduced_gain():
    hold = Hold(load=40.0)
    assert hold.shake(2.5)
    hold.measure(0.0)
    assert hold.control.note() == 'the object oscillates: the pose gain is reduced to 2 1/s'


@pytest.mark.parametrize(
    ('jump', 'fault'), [(0.019, Status.HALT_SLIPPED), (0.023, Status.HALT_NOT_HELD)]
)
def test_a_jump_by_more_than_20_mm_is_a_loss(jump, fault):
    assert Hold().measure(jump) is fault


def slipped():
    hold = Hold()
    for number in range(60):
        if hold.measure(6e-4 * number) is not None:
            break
    return hold


def test_the_note_of_a_slip_has_its_length_possible_causes_and_the_next_step():
    hold = slipped()
    assert hold.control.fault is Status.HALT_SLIPPED
    moved, causes = hold.control.note().split(' mm against the members, or ')
    assert 2 <= int(moved.removeprefix('the object moved by ')) <= 25
    assert causes == (
        'the tracker turned or jumped; next step: resume the grip (service resume_grip)'
    )


def test_the_first_fault_remains_until_a_client_acknowledges_it():
    hold = slipped()
    note = hold.control.note()
    hold.measure(0.1)
    assert (hold.control.fault, hold.control.note()) == (Status.HALT_SLIPPED, note)
    hold.control.acknowledge()
    assert (hold.control.fault, hold.control.note()) == (None, '')


def test_a_loss_during_an_oscillation_is_a_fault_that_remains():
    hold = Hold(load=40.0)
    assert hold.shake(2.5)
    hold.measure(0.1)
    for _ in range(100):
        hold.measure(0.1)
    assert hold.control.fault is Status.HALT_NOT_HELD


def test_a_short_slip_is_noted_for_three_seconds():
    hold, notes = Hold(), []
    hold.measure(6e-3)
    for number in range(35):
        assert hold.measure(6e-3 + 1e-5 * (-1) ** number, 0.1) is None
        notes.append(hold.control.note())
    assert notes[:25] == 25 * ['slipped by 6 mm, held']
    assert notes[-1] == ''


def test_an_unknown_squeeze_is_noted_with_a_slip():
    hold = Hold()
    assert hold.control.note((10.0, 4.9)) == ''
    hold.measure(0.006)
    note = hold.control.note((10.0, 5.1))
    assert note.startswith('slipped by 6 mm, held; held, squeeze unknown: 10.')


@pytest.mark.parametrize('mode', ['same value', 'same stamp'])
@pytest.mark.parametrize('seed', range(2))
def test_a_repeated_pose_is_no_slip(mode, seed):
    hold, rng = Hold(), np.random.default_rng(seed)
    for number in range(120):
        if number % 5 == 0:
            seen, stamp = MODEL.pose + rng.normal(size=3) * (1e-3, 1e-3, 9e-3), number * PERIOD
        if mode == 'same value':
            stamp = number * PERIOD
        else:
            seen = seen + 1e-12 * rng.normal(size=3)
        sample = StampedInput(Pose(*seen), stamp), number * PERIOD - stamp
        assert hold.control.follow(CONFIG, GRIP, PERIOD, sample) is HoldStatus.HELD
        assert hold.control.fault is None
