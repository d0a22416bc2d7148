# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Detection of slipping rollers from the change of their estimated offsets with travel."""

from __future__ import annotations

from collections import deque

from isotruss_ros.core.estimation.marker_gate import FALSE_ALARM_PROBABILITY
from isotruss_ros.core.numerics.arrays import Array
import numpy as np
import scipy

#: Smallest change of an offset under slip, in standard deviations [-].
SLIP_SIGMAS = -float(scipy.special.ndtri(FALSE_ALARM_PROBABILITY))
#: Two tests for slip, each with the smallest change of an offset as a fraction of the travel [-]
#: and the interval in which it occurs [s].
SLIP_SHARES = ((0.3, 0.25), (0.01, 4.0))
#: Smallest change of an offset under slip [m].
MIN_SLIP = 1e-3


class SlipWatch:
    """Detector of slipping rollers, which compares roller offsets with earlier estimates."""

    def __init__(self, count: int) -> None:
        self.slipping = np.zeros(count, dtype=bool)  #: (r,) mask of the slipping rollers
        self._kept: deque[tuple[float, Array, Array, Array]] = deque()

    def add(self, time: float, travel: Array, offsets: Array, variances: Array) -> None:
        """
        Add an estimate of the offsets, and compare it with earlier estimates.

        :param travel: (r,) encoder readings [m].
        :param variances: (r,) variances of the offsets [m^2].
        """
        estimates = self._kept
        while estimates and time - estimates[0][0] > SLIP_SHARES[-1][1]:
            estimates.popleft()
        self.slipping = np.zeros(len(offsets), dtype=bool)
        for share, span in SLIP_SHARES if estimates else ():
            before = (estimate for estimate in reversed(estimates) if time - estimate[0] >= span)
            _, turned, offsets_then, variances_then = next(before, estimates[0])
            change, rolled = offsets - offsets_then, travel - turned
            significant = np.abs(change) > SLIP_SIGMAS * np.sqrt(variances + variances_then)
            large = np.abs(change) > np.maximum(MIN_SLIP, share * np.abs(rolled))
            # A slipping tube lags behind its roller.
            self.slipping |= significant & large & (change * rolled < 0.0)
        estimates.append((time, travel, offsets, variances))
