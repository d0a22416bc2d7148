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
#: Smallest change of an offset under slip [m], and as a fraction of the travel [-].
MIN_SLIP, MIN_SLIP_SHARE = 1e-3, 0.01
#: Interval in which offsets are compared [s].
SLIP_SPAN = 4.0


class SlipWatch:
    """Detector of slipping rollers, which compares roller offsets with an earlier estimate."""

    def __init__(self, count: int) -> None:
        self.slipping = np.zeros(count, dtype=bool)  #: (r,) mask of the slipping rollers
        self._kept: deque[tuple[float, Array, Array, Array]] = deque()

    def add(self, time: float, travel: Array, offsets: Array, variances: Array) -> None:
        """Update `slipping` with offsets (r,), compared with the offsets `SLIP_SPAN` earlier."""
        self._kept.append((time, travel, offsets, variances))
        while time - self._kept[0][0] > SLIP_SPAN:
            self._kept.popleft()
        _, turned, offsets_then, variances_then = self._kept[0]
        change, rolled = offsets - offsets_then, travel - turned
        significant = np.abs(change) > SLIP_SIGMAS * np.sqrt(variances + variances_then)
        large = np.abs(change) > np.maximum(MIN_SLIP, MIN_SLIP_SHARE * np.abs(rolled))
        # A slipping tube lags behind its roller.
        self.slipping = significant & large & (change * rolled < 0.0)
