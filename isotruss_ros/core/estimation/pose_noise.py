# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Variance of the noise of measured poses, estimated from differences of successive poses."""

from __future__ import annotations

from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Prior standard deviations of the coordinates [m] and of the angle [rad].
PRIOR_DEVIATIONS = np.array([1e-3, 1e-3, 0.009])
#: Error of the model between two poses, rotations times the characteristic radius [m].
MODEL_ERROR = 1e-4
#: Smallest weight of a pose in the average [-].
MIN_WEIGHT = 0.02
#: Largest difference of poses that counts as noise, in standard deviations [-].
MAX_STEP_SIGMAS = 3.0


class PoseNoise:
    """
    Estimated variances (3,) of white noise in the poses of a slowly moving object [m^2].

    They include the model error. Angles are multiplied by the characteristic radius.
    """

    def __init__(self, deviations: Array) -> None:
        self.variances = deviations**2
        self._last: Array | None = None
        self._weight = 0.2  # of the next pose; the prior weighs as much as four poses

    def add(self, off: Array) -> None:
        """Update the variances with a pose (3,) minus the pose by roller travel alone [m]."""
        last, self._last = self._last, off
        if last is None:
            return
        largest = MAX_STEP_SIGMAS**2 * self.variances
        squares = np.minimum(0.5 * (off - last) ** 2, largest)
        mean = self.variances + self._weight * (squares - self.variances)
        self.variances = np.maximum(mean, MODEL_ERROR**2)
        self._weight = max(self._weight / (1.0 + self._weight), MIN_WEIGHT)

    @property
    def deviation(self) -> float:
        """Return the largest standard deviation of x, y and the angle times a radius [m]."""
        return float(np.sqrt(self.variances.max()))
