# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Slip from sums of pose corrections of the object, and noise from successive poses."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
import math
from typing import NamedTuple

from isotruss_ros.core.estimation.fault_thresholds import SUM_INTERVALS
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.frozen import replace
import numpy as np

#: Prior standard deviations of the coordinates [m] and of the angle [rad].
PRIOR_DEVIATIONS = np.array([1e-3, 1e-3, 0.009])
#: Error of the model between two poses, rotations times the characteristic radius [m].
MODEL_ERROR = 1e-4
#: Smallest weight of a pose in the average [-].
MIN_WEIGHT = 0.02
#: Largest difference of poses that counts as noise, in standard deviations [-].
MAX_STEP_SIGMAS = 3.0


class Sum(NamedTuple):
    """Sum of the pose corrections before a time, and the covariances at this time."""

    time: float  #: [s]
    correction: Array  #: (3,) sum of all earlier corrections of the pose [m]
    walk: Array  #: (3, 3) covariance of the contacts' random walk [m^2]
    prior: Array  #: (3, 3) covariance of contacts and unexplained pose [m^2]
    by_offsets: Array  #: (3, c) derivatives of the pose by the roller offsets


@dataclass(frozen=True, eq=False)
class ContactWalk:
    """
    Detector of slip from sums of pose corrections and their standard deviations without slip.

    The deviations are due to a random walk of the contacts, pose noise and load.

    :ivar length: norm of the largest sum, with rotations times the characteristic radius [m].
    :ivar deviations: largest ratio of a sum to its expected standard deviation [-].
    :ivar correction: (3,) sum of all corrections of the pose [m].
    :ivar walk: (3, 3) covariance of the contacts' random walk [m^2].
    :ivar jumps: (3, c) jumps of the derivatives by offsets, which are no slip.
    :ivar windows: sums within each of `SUM_INTERVALS`, in order of time.
    """

    length: float = 0.0
    deviations: float = 0.0
    correction: Array = field(default_factory=partial(np.zeros, 3))
    walk: Array = field(default_factory=partial(np.zeros, (3, 3)))
    jumps: Array | float = 0.0
    windows: tuple[tuple[Sum, ...], ...] = ((),) * len(SUM_INTERVALS)

    def added(
        self, time: float, change: Array, prior: Array, noise: Array, rates: Array, offsets: Array
    ) -> ContactWalk:
        """
        Return the detector after a correction (3,) of the pose, without its part by the load [m].

        :param prior: (3, 3) covariance of contacts and unexplained pose before it [m^2].
        :param noise: (3, 3) covariance of pose noise and load [m^2].
        :param rates: (3, c) derivatives of the pose by the roller offsets. If they change, an
            error of an offset moves the pose.
        :param offsets: (c, c) covariance of the roller offsets [m^2].
        """
        # The sum before this time starts a window; sums older than a window's interval leave it.
        by_offsets = rates - self.jumps
        before = Sum(time, self.correction, self.walk, prior, by_offsets)
        correction = self.correction + change
        windows = tuple(
            _drop_old((*window, before), time, interval)
            for window, interval in zip(self.windows, SUM_INTERVALS, strict=True)
        )
        # Sum of the corrections in each window. First axis: window.
        starts = [window[0] for window in windows]
        sums = correction - np.array([start.correction for start in starts])
        # Covariances of the sums without slip: S = prior + walk + noise + B C B^T.
        walks = self.walk - np.array([start.walk for start in starts])
        rate_changes = by_offsets - np.array([start.by_offsets for start in starts])
        by_rate_changes = rate_changes @ offsets @ rate_changes.transpose(0, 2, 1)
        covariances = np.array([start.prior for start in starts]) + walks + noise + by_rate_changes
        # Largest Mahalanobis distance of a sum s from zero, sqrt(s^T S^-1 s).
        weighted = np.linalg.solve(covariances, sums[:, :, None])[:, :, 0]  # sums are columns
        return replace(
            self,
            length=float(np.hypot.reduce(sums, axis=1).max()),
            deviations=math.sqrt((sums * weighted).sum(axis=1).max()),
            correction=correction,
            windows=windows,
        )


def _drop_old(window: tuple[Sum, ...], time: float, interval: float) -> tuple[Sum, ...]:
    """Return the sums of an interval [s] that ends at a time."""
    count = next(i for i, start in enumerate(window) if time - start.time <= interval)
    return window[count:]


@dataclass(frozen=True, eq=False)
class PoseNoise:
    """
    Estimated variances of white noise in the poses of a slowly moving object.

    They include the model error. Angles are multiplied by the characteristic radius.

    :ivar variances: (3,) variances [m^2].
    :ivar previous: (3,) last residual, see `added` [m]; None before the first pose.
    :ivar weight: weight of the next pose [-]; the prior weighs as much as four poses.
    """

    variances: Array
    previous: Array | None = None
    weight: float = 0.2

    def added(self, residual: Array) -> PoseNoise:
        """Return the variances after a pose (3,), minus the pose by roller travel alone [m]."""
        if self.previous is None:
            return replace(self, previous=residual)
        # Half of the square, because both residuals have noise.
        half_squares = 0.5 * (residual - self.previous) ** 2
        squares = np.minimum(half_squares, MAX_STEP_SIGMAS**2 * self.variances)
        averages = self.variances + self.weight * (squares - self.variances)
        # The weights 1/5, 1/6, 1/7, ... give the arithmetic mean, until they are the smallest.
        weight = max(self.weight / (1.0 + self.weight), MIN_WEIGHT)
        return PoseNoise(np.maximum(averages, MODEL_ERROR**2), residual, weight)
