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
