# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Oscillations of a held object: those that do not decay are detected."""

from isotruss_ros.core.servo.grip_faults import SwingWatch
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


@pytest.mark.parametrize(('noise', 'detected'), [(0.0, True), (2e-3, False)])
def test_swings_within_the_noise_of_the_pose_are_no_oscillation(noise, detected):
    found = detect(lambda t: 0.002 * np.sin(10.0 * t), known=noise)
    assert (found is not None) is detected


def test_noise_is_no_oscillation():
    assert detect(lambda t: 0.0, noise=1e-3, duration=300.0) is None


def test_errors_after_cycles_longer_than_a_half_period_are_no_oscillation():
    watch = SwingWatch(12.0)
    # Lengths of cycles [s] and pose errors [mm], recorded on a busy machine.
    late = [(0.7, 1.0), (1.01, 2.4), (0.46, 1.9), (0.08, 13.9), (0.62, -11.4), (0.06, 16.6)]
    decay = [(0.055, 13.2), (0.05, 11.3), (0.05, 9.2), (0.04, 7.5), (0.06, 6.5), (0.03, 5.4)]
    for elapsed, error in late + decay:
        assert not watch.update(np.array([0.0, 1e-3 * error, 0.0]), 1e-4, elapsed)
