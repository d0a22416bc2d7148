# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Slip from sums of pose corrections of the object, and noise from successive poses."""

from __future__ import annotations

from collections import deque
import math
from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Intervals over which corrections are summed [s].
SUM_INTERVALS = (0.2, 0.6, 1.5, 3.0)
#: Length of an inconsistent innovation above which the object counts as lost [m].
JUMP_LENGTH = 0.02
#: Prior standard deviations of the coordinates [m] and of the angle [rad].
PRIOR_DEVIATIONS = np.array([1e-3, 1e-3, 0.009])
#: Error of the model between two poses, rotations times the characteristic radius [m].
MODEL_ERROR = 1e-4
#: Smallest weight of a pose in the average [-].
MIN_WEIGHT = 0.02
#: Largest difference of poses that counts as noise, in standard deviations [-].
MAX_STEP_SIGMAS = 3.0


class _Sum(NamedTuple):
    """Sum of the pose corrections before a time, and the covariances at this time."""

    time: float  #: [s]
    correction: Array  #: (3,) sum of all earlier corrections of the pose [m]
    walk: Array  #: (3, 3) covariance of the contacts' random walk [m^2]
    prior: Array  #: (3, 3) covariance of contacts and unexplained pose [m^2]
    by_offsets: Array  #: (3, c) derivatives of the pose by the roller offsets


class ContactWalk:
    """
    Detector of slip from sums of pose corrections and their standard deviations without slip.

    The deviations are due to a random walk of the contacts, pose noise and load.

    :ivar length: norm of the largest sum, with rotations times the characteristic radius [m].
    :ivar deviations: largest ratio of a sum to its expected standard deviation [-].
    """

    def __init__(self) -> None:
        self.length = self.deviations = 0.0
        self._correction, self._walk = np.zeros(3), np.zeros((3, 3))
        self._jumps: Array | float = 0.0  # jumps of the derivatives by offsets, see `exclude_jump`
        #: Sums within each of `SUM_INTERVALS`, in order of time.
        self._windows: tuple[deque[_Sum], ...] = tuple(deque() for _ in SUM_INTERVALS)

    def spread(self, noise: Array) -> None:
        """Add process noise (3, 3) to the covariance of the contacts' random walk [m^2]."""
        self._walk = self._walk + noise

    def exclude_jump(self, jump: Array) -> None:
        """Exclude a jump (3, c) of the derivatives by offsets from the detection of slip."""
        self._jumps = self._jumps + jump

    def add(
        self, time: float, change: Array, prior: Array, noise: Array, rates: Array, offsets: Array
    ) -> None:
        """
        Add a correction (3,) of the estimated pose, without its part by the load [m].

        :param prior: (3, 3) covariance of contacts and unexplained pose before it [m^2].
        :param noise: (3, 3) covariance of pose noise and load [m^2].
        :param rates: (3, c) derivatives of the pose by the roller offsets. If they change, an
            error of an offset moves the pose.
        :param offsets: (c, c) covariance of the roller offsets [m^2].
        """
        # The sum before this time starts a window; sums older than a window's interval leave it.
        by_offsets = rates - self._jumps
        before = _Sum(time, self._correction, self._walk, prior, by_offsets)
        self._correction = self._correction + change
        for window, interval in zip(self._windows, SUM_INTERVALS, strict=True):
            window.append(before)
            while time - window[0].time > interval:
                window.popleft()
        # Sum of the corrections in each window. First axis: window.
        starts = [window[0] for window in self._windows]
        sums = self._correction - np.array([start.correction for start in starts])
        self.length = float(np.hypot.reduce(sums, axis=1).max())
        # Covariances of the sums without slip: S = prior + walk + noise + B C B^T.
        walks = self._walk - np.array([start.walk for start in starts])
        rate_changes = by_offsets - np.array([start.by_offsets for start in starts])
        by_rate_changes = rate_changes @ offsets @ rate_changes.transpose(0, 2, 1)
        covariances = np.array([start.prior for start in starts]) + walks + noise + by_rate_changes
        # Largest Mahalanobis distance of a sum s from zero, sqrt(s^T S^-1 s).
        weighted = np.linalg.solve(covariances, sums[:, :, None])[:, :, 0]  # sums are columns
        self.deviations = math.sqrt((sums * weighted).sum(axis=1).max())


class PoseNoise:
    """
    Estimated variances (3,) of white noise in the poses of a slowly moving object [m^2].

    They include the model error. Angles are multiplied by the characteristic radius.
    """

    def __init__(self, deviations: Array) -> None:
        self.variances = deviations**2
        self._previous: Array | None = None
        self._weight = 0.2  # of the next pose; the prior weighs as much as four poses

    def add(self, residual: Array) -> None:
        """Update the variances with a pose (3,) minus the pose by roller travel alone [m]."""
        previous, self._previous = self._previous, residual
        if previous is None:
            return
        # Half of the square, because both residuals have noise.
        squares = np.minimum(0.5 * (residual - previous) ** 2, MAX_STEP_SIGMAS**2 * self.variances)
        averages = self.variances + self._weight * (squares - self.variances)
        self.variances = np.maximum(averages, MODEL_ERROR**2)
        # The weights 1/5, 1/6, 1/7, ... give the arithmetic mean, until they are the smallest.
        self._weight = max(self._weight / (1.0 + self._weight), MIN_WEIGHT)
