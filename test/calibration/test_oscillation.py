# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The fit of one damped oscillation to measured poses."""

from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.calibration.oscillation import fit_oscillation
import numpy as np
import pytest

TIMES, ARM = np.arange(0.0, 3.0, 0.01), 0.15


def swing(frequency, damping, noise=0.0):
    """Return the poses of an oscillation of 6 mm along a line that turns as well."""
    rng = np.random.default_rng(3)
    decay, damped = damping * frequency, frequency * np.sqrt(1.0 - damping**2)
    along = 0.006 * np.exp(-decay * TIMES) * np.cos(damped * TIMES + 0.4)
    poses = np.array((0.7, 0.4, 0.2)) + np.outer(along, (0.8, -0.6, 1.0))
    return poses + noise * rng.normal(size=poses.shape) / (1.0, 1.0, ARM)


@pytest.mark.parametrize('damping', [0.02, 0.1, 0.5])
@pytest.mark.parametrize('frequency', [2.5, 9.0, 23.0])
def test_fit_of_an_exact_oscillation_is_exact(frequency, damping):
    result = fit_oscillation(TIMES, swing(frequency, damping), ARM)
    assert result[:2] == pytest.approx((frequency, damping), rel=1e-6)


def test_fit_with_noise_of_one_millimetre_is_within_its_tolerance():
    result = fit_oscillation(TIMES, swing(9.0, 0.1, 0.001), ARM)
    assert result.frequency == pytest.approx(9.0, rel=0.02)
    assert result.damping_ratio == pytest.approx(0.1, rel=0.2)


def test_a_creeping_motion_is_no_oscillation():
    with pytest.raises(MeasurementError, match='not one damped oscillation'):
        fit_oscillation(TIMES, np.outer(TIMES, (0.01, 0.0, 0.0)), ARM)
