# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Oscillations of a held object: those that do not decay are detected."""

from isotruss_ros.core.servo.swing_watch import SwingWatch
import numpy as np
import pytest

PERIOD = 0.01


def detect(error, noise=0.0, duration=5.0, known=None):
    """Return the time at which an oscillation of an error(t) [m] is detected; None if never."""
    watch, rng = SwingWatch(12.0), np.random.default_rng(0)
    for k in range(round(duration / PERIOD)):
        t = k * PERIOD
        away = np.array([0.0, error(t), 0.0]) + noise * rng.normal(size=3)
        if watch.update(away, noise if known is None else known, PERIOD):
            return t
    return None


@pytest.mark.parametrize('rate', [0.0, 0.5])
def test_swings_that_do_not_decay_are_an_oscillation(rate):
    assert detect(lambda t: 0.004 * np.exp(rate * t) * np.sin(10.0 * t)) < 1.6


@pytest.mark.parametrize(
    'error',
    [
        lambda t: 0.02 * np.exp(-2.0 * t) * np.sin(10.0 * t),
        lambda t: 0.0009 * np.sin(10.0 * t),
        lambda t: 0.02 * np.sin(2.0 * t),
    ],
)
def test_decaying_small_and_slow_swings_are_no_oscillation(error):
    assert detect(error) is None


@pytest.mark.parametrize('offset', [-0.05, 0.05])
@pytest.mark.parametrize(('size', 'detected'), [(0.0009, False), (0.004, True)])
def test_swings_are_found_wherever_the_object_is(offset, size, detected):
    found = detect(lambda t: offset + size * np.sin(10.0 * t), duration=8.0)
    assert (found is not None) is detected


@pytest.mark.parametrize(('noise', 'detected'), [(0.0, True), (2e-3, False)])
def test_swings_within_the_noise_of_the_pose_are_no_oscillation(noise, detected):
    found = detect(lambda t: 0.002 * np.sin(10.0 * t), known=noise)
    assert (found is not None) is detected


def test_noise_is_no_oscillation():
    assert detect(lambda t: 0.0, noise=1e-3, duration=300.0) is None


def test_an_object_far_heavier_than_in_the_model_oscillates():
    """Its gain is 0.25 of the frequency in the model; only slower objects swing with this gain."""
    slow = 0.2 * 12.0
    assert detect(lambda t: 0.004 * np.exp(0.2 * t) * np.sin(slow * t), duration=8.0) < 7.0


@pytest.mark.parametrize(('share', 'detected'), [(0.2, False), (0.6, True)])
def test_swings_are_compared_with_the_commanded_travel(share, detected):
    """An object shaken by its client swings by a share of the commanded travel."""
    watch, told = SwingWatch(12.0), []
    for k in range(500):
        pose = share * 0.01 * np.array([np.sin(10.0 * k * PERIOD), 0.0, 0.0])
        travel = 0.01 * abs(np.sin(10.0 * (k + 1) * PERIOD) - np.sin(10.0 * k * PERIOD))
        told.append(watch.update(pose, 0.0, PERIOD, travel))
    assert any(told) is detected


@pytest.mark.parametrize(('mean', 'detected'), [(0.033, True), (0.3, False)])
def test_oscillations_are_detected_from_irregular_poses_that_resolve_them(mean, detected):
    watch, rng, t, told = SwingWatch(12.0), np.random.default_rng(0), 0.0, []
    while t < 6.0:
        since = mean * rng.uniform(0.4, 1.6)
        t += since
        told.append(watch.update(np.array([0.01 * np.sin(10.0 * t), 0.0, 0.0]), 0.0, since))
    assert any(told) is detected


def test_errors_after_cycles_longer_than_a_half_period_are_no_oscillation():
    watch = SwingWatch(12.0)
    # Lengths of cycles [s] and pose errors [mm], recorded on a busy machine.
    late = [(0.7, 1.0), (1.01, 2.4), (0.46, 1.9), (0.08, 13.9), (0.62, -11.4), (0.06, 16.6)]
    decay = [(0.055, 13.2), (0.05, 11.3), (0.05, 9.2), (0.04, 7.5), (0.06, 6.5), (0.03, 5.4)]
    for elapsed, error in late + decay:
        assert not watch.update(np.array([0.0, 1e-3 * error, 0.0]), 1e-4, elapsed)
