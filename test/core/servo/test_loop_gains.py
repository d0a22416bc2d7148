# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The gains of the squeeze control against one mode behind its loop."""

from isotruss_ros.core.servo.swing_watch import DEFAULT_FREQUENCY, GAIN_SHARE
import numpy as np
import pytest


def growth(gain, damping, frequency=1.0):
    """Return the largest growth rate of the linear loop: integrator, two low-passes, one mode."""
    # States: rollers r, mode y and its speed, low-passes a and b of y - r.
    loop = np.zeros((5, 5))
    loop[0, [0, 4]] = -gain
    loop[1, 2] = 1.0
    loop[2, :3] = frequency**2, -(frequency**2), -2.0 * damping * frequency
    loop[3, [0, 1, 3]] = -gain, gain, -gain
    loop[4, [3, 4]] = gain, -gain
    return np.linalg.eigvals(loop).real.max()


@pytest.mark.parametrize('damping', [0.0, 0.02, 0.1, 0.5])
@pytest.mark.parametrize('wrong', [0.5, 1.0, 3.0])
def test_gain_is_stable_for_a_frequency_wrong_by_a_factor_of_two(damping, wrong):
    gain = GAIN_SHARE * 10.0
    assert growth(gain, damping, wrong * 10.0) < 0.0


def test_the_gain_for_an_unknown_frequency_is_stable_from_1_2_rad_per_s_on():
    gain = GAIN_SHARE * DEFAULT_FREQUENCY
    assert growth(gain, 0.0, 1.2) < 0.0 < growth(gain, 0.0, 1.0)
