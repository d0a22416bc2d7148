# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Oscillations of a held object, and gains of the loop that excite none."""

import math

from isotruss_ros.core.servo.squeeze_control import SwingWatch
import numpy as np
import pytest

PERIOD = 0.01


class Poses:
    """Poses of an object whose lowest natural frequency is known or not [rad/s]."""

    def __init__(self, frequency=None):
        self.watch = SwingWatch.of(frequency)

    def add(self, *pose):
        """Return whether the object oscillates after a pose."""
        self.watch, oscillates = self.watch.updated(*pose)
        return oscillates


def swinging(
    height, rate, known=None, noise=0.0, axis=0, poses=None, duration=9.0, decay=1.0, offset=0.0
):
    """
    Return whether a sine with a height from minimum to maximum [m] is an oscillation.

    :param duration: phase at the end [rad].
    :param decay: ratio of the swings of successive half periods [-].
    """
    poses, step = poses or Poses(known), 0.05 / rate
    for number in range(round(duration / (step * rate))):
        pose = np.full(3, offset)
        phase = rate * number * step
        pose[axis] += 0.5 * height * decay ** (phase / math.pi) * math.sin(phase)
        if poses.add(pose, noise, step, 0.0):
            return True
    return False


@pytest.mark.parametrize(
    ('decay', 'detected'), [(0.9, False), (0.94, False), (0.965, True), (1.04, True)]
)
def test_only_swings_that_hardly_decay_are_an_oscillation(decay, detected):
    assert swinging(0.1, 12.0, 12.0, duration=25.0, decay=decay) is detected


#: Height of swings of 1.5 mm behind a low-pass filter with the frequency of the swings [m].
HEIGHT = 0.0015 * math.sqrt(2.0)


@pytest.mark.parametrize(
    ('quantity', 'threshold', 'settings'),
    [
        ('duration', 3.25 * math.pi, {'height': 0.1, 'rate': 12.0, 'known': 12.0}),
        *(
            ('height', HEIGHT, {'rate': rate, 'known': known, 'axis': axis})
            for axis in range(3)
            for rate, known in ((12.0, 12.0), (2.4, None))  # the frequency is 2.4 rad/s if unknown
        ),
        *(
            ('height', HEIGHT, {'rate': 12.0, 'known': 12.0, 'offset': offset, 'duration': 80.0})
            for offset in (-0.05, 0.05)
        ),
        # Five deviations of the noise.
        ('height', HEIGHT * 10.0 / 1.5, {'rate': 12.0, 'known': 12.0, 'noise': 2e-3}),
        # A half period lasts 5.5 half periods of the object and 2.6 s at most.
        ('rate', 12.0 / 5.5, {'height': 0.1, 'known': 12.0}),
        ('rate', 1.2, {'height': 0.1, 'known': None}),
        ('rate', 1.2, {'height': 0.1, 'known': 4.0}),
    ],
)
def test_three_swings_beyond_the_thresholds_are_an_oscillation(quantity, threshold, settings):
    share = 0.08 if quantity == 'duration' else 0.03
    for factor, detected in ((1.0 - share, False), (1.0 + share, True)):
        values = {'duration': 16.0} | settings | {quantity: factor * threshold}
        assert swinging(**values) is detected


def test_a_restarted_detection_needs_three_more_swings():
    poses = Poses(12.0)
    assert not swinging(0.01, 12.0, poses=poses, duration=2.9 * math.pi)
    poses.watch = poses.watch.restarted()
    assert not swinging(0.01, 12.0, poses=poses, duration=2.4 * math.pi)
    assert swinging(0.01, 12.0, poses=poses, duration=3.5 * math.pi)


@pytest.mark.parametrize('axis', range(3))
@pytest.mark.parametrize('away', [-7e-3, 7e-3])
@pytest.mark.parametrize('before', [0.0, -6e-3, -3e-3, -1.6e-3, 3e-3])
@pytest.mark.parametrize('shift', [0.3, 3.0])
def test_one_step_each_way_is_no_oscillation_whatever_motion_came_before(
    axis, away, before, shift
):
    """The object drifts for a time [s], is pulled away, and returns by 2 % less."""
    poses, told = Poses(8.0), []
    places = [before * min(k * PERIOD / shift, 1.0) for k in range(round(shift / PERIOD) + 50)]
    for share, count in ((1.0, 100), (0.02, 100), (0.4, 100), (0.02, 100)):
        places += [before + share * away] * count
    for place in places:
        pose = np.zeros(3)
        pose[axis] = place
        told.append(poses.add(pose, 0.0, PERIOD, 0.0))
    assert not any(told)


def test_noise_is_no_oscillation():
    poses, rng = Poses(12.0), np.random.default_rng(0)
    for _ in range(6000):
        pose = 1e-3 * rng.normal(size=3)
        assert not poses.add(pose, 1e-3, PERIOD, 0.0)


@pytest.mark.parametrize(('share', 'detected'), [(0.2, False), (0.6, True)])
def test_swings_are_compared_with_the_commanded_travel(share, detected):
    """An object shaken by its client swings by a share of the commanded travel."""
    poses, told = Poses(12.0), []
    for k in range(500):
        pose = share * 0.01 * np.array([np.sin(10.0 * k * PERIOD), 0.0, 0.0])
        travel = 0.01 * abs(np.sin(10.0 * (k + 1) * PERIOD) - np.sin(10.0 * k * PERIOD))
        told.append(poses.add(pose, 0.0, PERIOD, travel))
    assert any(told) is detected


@pytest.mark.parametrize(('mean', 'detected'), [(0.033, True), (0.07, True), (0.3, False)])
def test_oscillations_are_detected_from_irregular_poses_that_resolve_them(mean, detected):
    poses, rng, t, told = Poses(12.0), np.random.default_rng(0), 0.0, []
    while t < 6.0:
        since = mean * rng.uniform(0.4, 1.6)
        t += since
        told.append(poses.add(np.array([0.01 * np.sin(10.0 * t), 0.0, 0.0]), 0.0, since, 0.0))
    assert any(told) is detected


def test_errors_after_cycles_longer_than_a_half_period_are_no_oscillation():
    poses = Poses(12.0)
    # Lengths of cycles [s] and pose errors [mm], recorded on a busy machine.
    late = [(0.7, 1.0), (1.01, 2.4), (0.46, 1.9), (0.08, 13.9), (0.62, -11.4), (0.06, 16.6)]
    decay = [(0.055, 13.2), (0.05, 11.3), (0.05, 9.2), (0.04, 7.5), (0.06, 6.5), (0.03, 5.4)]
    for elapsed, error in late + decay:
        assert not poses.add(np.array([0.0, 1e-3 * error, 0.0]), 1e-4, elapsed, 0.0)
