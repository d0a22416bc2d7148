# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the watch over a grip tells apart: slips, loads, poses that lie, and oscillations."""

from isotruss_ros.core.control.grip_watch import GripFault, GripWatch
from isotruss_ros.core.control.held_model import Observation
import numpy as np
import pytest

PERIOD = 0.01


def watch(
    off=lambda t: 0.0,
    error=lambda t: 0.0,
    asked=(0.0, 0.0),
    measured=None,
    duration=5.0,
    explained=0.0,
    noise=0.0,
    borne=True,
):
    """
    Return the first fault and when it comes; lengths in m.

    The object is off its model along x. It is measured where it was asked to go and off, or goes
    a measured share of what is asked.
    """
    asked, moved = PERIOD * np.array([*asked, 0.0]), np.zeros(3)
    grip, rng = GripWatch(12.0), np.random.default_rng(0)
    for k in range(round(duration / PERIOD)):
        t, last = k * PERIOD, moved
        apart = np.array([off(t), 0.0, 0.0]) + noise * rng.normal(size=3)
        away = np.array([0.0, error(t), 0.0]) + noise * rng.normal(size=3)
        moved = k * asked + apart
        if measured is not None:
            moved = measured * k * asked + noise * rng.normal(size=3) * (measured > 0.0)
        seen = Observation(apart, (1.0 - explained) * apart, borne)
        fault = grip.update(seen, away, asked, moved - last, PERIOD)
        if fault is not None:
            return fault, t
    return None, duration


def test_an_object_that_stays_off_the_model_has_slipped_after_two_seconds():
    fault, time = watch(lambda t: 0.006 if t > 1.0 else 0.0)
    assert fault is GripFault.SLIPPED
    assert time == pytest.approx(3.0, abs=0.1)


def test_an_object_that_departs_under_more_than_the_grip_bears_has_slipped_at_once():
    fault, time = watch(lambda t: 0.01 * max(t - 1.0, 0.0), borne=False)
    assert fault is GripFault.SLIPPED
    assert time == pytest.approx(1.55, abs=0.02)


@pytest.mark.parametrize('off', [lambda t: 0.0045 * (t > 1.0), lambda t: 0.03 * (1.0 < t < 2.9)])
def test_a_small_and_a_short_difference_are_no_slip(off):
    assert watch(off)[0] is None


def test_a_load_that_is_expected_is_no_slip():
    assert watch(lambda t: 0.02 * (t > 1.0), explained=0.9)[0] is None


def test_a_pose_that_stands_still_where_the_object_is_carried_lies():
    fault, time = watch(lambda t: -0.03 * t, asked=(0.03, 0.0), measured=0.0)
    assert fault is GripFault.POSE_DISAGREES
    assert 0.03 * time < 0.01


def test_a_pose_that_stands_still_on_a_path_that_turns_back_lies():
    grip = GripWatch()
    for k in range(300):
        t = k * PERIOD
        model = 0.005 * np.sin(3.0 * t)
        asked = 0.015 * PERIOD * np.cos(3.0 * t)
        x = np.array([1.0, 0.0, 0.0])
        seen = Observation(-model * x, -model * x)
        if grip.update(seen, 0.0 * x, asked * x, 0.0 * x, PERIOD) is GripFault.POSE_DISAGREES:
            break
    assert abs(model) < 0.005
    assert t < 2.0


def test_a_pose_that_stands_still_where_the_path_stands_is_no_lie():
    """A load that grows, against which the loop carries the object."""
    assert watch(lambda t: 0.015 * t, measured=0.0, explained=0.9)[0] is None


@pytest.mark.parametrize(('share', 'noise'), [(0.15, 0.0), (0.5, 0.0), (1.0, 0.0), (1.0, 1e-3)])
def test_a_pose_that_goes_as_asked_where_the_object_stays_behind_lies(share, noise):
    fault, time = watch(lambda t: share * 0.03 * t, asked=(0.0, 0.03), measured=1.0, noise=noise)
    assert fault is GripFault.POSE_DISAGREES
    assert share * 0.03 * time < 0.01


@pytest.mark.parametrize('size', [0.02, -0.02])
@pytest.mark.parametrize('asked', [0.0, 0.02, 0.06])
def test_a_load_that_comes_on_the_way_is_no_lie(asked, size):
    """As it swings an object on soft tubes: the demonstration's by 5 N at 60 mm/s."""

    def swing(t):
        return 0.5 * size * (1.0 - np.cos(12.0 * max(t - 1.0, 0.0)))

    assert watch(swing, asked=(asked, 0.0), duration=2.9)[0] is None


def test_what_an_expected_load_explains_is_no_lie():
    fault, _ = watch(
        lambda t: 0.015 * t, asked=(0.0, 0.03), measured=1.0, explained=0.9, duration=3.0
    )
    assert fault is None


@pytest.mark.parametrize('rate', [0.0, 0.5])
def test_swings_that_do_not_decay_are_an_oscillation(rate):
    fault, time = watch(error=lambda t: 0.004 * np.exp(rate * t) * np.sin(10.0 * t))
    assert fault is GripFault.OSCILLATES
    assert time < 1.6


@pytest.mark.parametrize(
    'error',
    [
        lambda t: 0.02 * np.exp(-2.0 * t) * np.sin(10.0 * t),
        lambda t: 0.0014 * np.sin(10.0 * t),
        lambda t: 0.02 * np.sin(2.0 * t),
    ],
)
def test_decaying_small_and_slow_swings_are_none(error):
    assert watch(error=error)[0] is None


@pytest.mark.parametrize(('noise', 'known'), [(0.0, True), (2e-3, False)])
def test_swings_count_as_noise_lets_them(noise, known):
    """Of 2 mm, or of 2.5 times the steps of noise."""
    grip, nothing = GripWatch(12.0), np.zeros(3)
    seen, found = Observation(nothing, nothing, noise=noise), set()
    for k in range(300):
        error = np.array([0.0, 0.002 * np.sin(0.1 * k), 0.0])
        found.add(grip.update(seen, error, nothing, nothing, PERIOD))
    assert (GripFault.OSCILLATES in found) is known


def test_noise_raises_no_alarm():
    assert watch(asked=(0.0, 0.03), noise=1e-3, duration=300.0)[0] is None
