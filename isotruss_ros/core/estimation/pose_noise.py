# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Variance of the noise of measured poses, from the steps between them."""

from __future__ import annotations

from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Deviations until it is known: of a coordinate [m] and of the angle [rad].
UNKNOWN_NOISE = np.array([1e-3, 1e-3, 0.009])
#: Error of the model that is left between poses, turns times the arm [m].
MODEL_ERROR = 1e-4
#: Number of poses over which it is averaged, and of those that the first guess counts for.
MEMORY, GUESS = 50, 4
#: Larger steps count for so many standard deviations: they are no noise.
LARGEST_STEP = 3.0


class PoseNoise:
    """
    Estimates the noise, which changes from pose to pose; what an object does is slower.

    :ivar variances: (3,) of x, y and the angle times the arm, the model's included [m^2].
    :param deviations: (3,) of these, until they are known [m].
    """

    def __init__(self, deviations: Array) -> None:
        self.variances = deviations**2
        self._last: Array | None = None
        self._count = GUESS

    def add(self, off: Array) -> None:
        """
        Take a pose in.

        :param off: (3,) of the pose against where the rollers alone have moved the object, turns
            times the arm [m].
        """
        last, self._last = self._last, off
        if last is None:
            return
        most = LARGEST_STEP**2 * self.variances
        found = np.minimum(0.5 * (off - last) ** 2, most)
        self._count = min(self._count + 1, MEMORY)
        mean = self.variances + (found - self.variances) / self._count
        self.variances = np.maximum(mean, MODEL_ERROR**2)

    @property
    def deviation(self) -> float:
        """Return the largest standard deviation [m]."""
        return float(np.sqrt(self.variances.max()))
