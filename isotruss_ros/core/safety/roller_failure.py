# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Detection of failed rollers, which do not move for a given time although they are commanded.

The range (maximum minus minimum) of the commanded travel is compared with that of the measured
travel. So delays, oscillating commands, and noise without drift do not lead to false detections.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
import math

from isotruss_ros.core.model.topology import check_names
from isotruss_ros.core.numerics.arrays import Array, Flags
import numpy as np

#: A commanded roller that does not move for this time has failed [s].
FAILURE_TIME = 1.0
#: Smallest commanded speed that counts as a command [m/s]; at lower speeds a roller may stick.
MIN_SPEED = 0.002
#: Smallest ratio of measured to commanded range of a working roller [-].
MIN_SHARE = 0.25
#: Largest delay between a command and the roller's motion [s].
SETTLING_TIME = 0.2
#: Commanded range after which a roller with sufficient measured range counts as working [m].
EVIDENT_TRAVEL = 0.02


class FailureDetector:
    """
    Detector of failed rollers, which compares commanded with measured travel.

    A failed roller is reported until it is reset, because a roller at rest cannot prove that it
    works. `failure_time` [s] may be changed at any time.
    """

    def __init__(self, names: Sequence[str], failure_time: float = FAILURE_TIME) -> None:
        count = len(names)
        self.failed: frozenset[str] = frozenset()
        self.failure_time = failure_time
        self._names = tuple(names)
        self._time = math.nan
        self._sent = np.zeros(count)  # commanded travel [m]
        self._active = np.zeros(count)  # time with a command since the roller last moved [s]
        self._path = np.zeros(count)  # commanded path length in that time [m]
        self._asked = np.full(count, np.nan)  # commanded range to compare with; nan: none [m]
        self._asked_at = np.zeros(count)  # time at which that range was commanded [s]
        # Minimum and maximum of commanded and measured travel (2, r) since the last restart [m].
        self._least, self._most = np.zeros((2, 2, count))

    def reset(self, names: Collection[str] | None = None) -> None:
        """Regard some or all rollers as working again, and restart the comparison for all."""
        cleared = frozenset(self._names if names is None else names)
        check_names('rollers', cleared, self._names)
        self.failed -= cleared
        self._time = math.nan

    def update(self, positions: Array, time: float, commanded: Array) -> None:
        """Compare measured travel (r,) [m] with speeds since the previous sample [m/s]."""
        if time == self._time:
            return
        elapsed = time - self._time
        self._time = time
        # After samples that are out of order or far apart, the comparison restarts.
        if not 0.0 < elapsed <= FAILURE_TIME:
            self._restart(slice(None), np.array([self._sent, positions]))
            return
        has_command = np.abs(commanded) >= MIN_SPEED
        step = elapsed * np.where(has_command, commanded, 0.0)
        self._sent += step
        self._path += np.abs(step)
        self._active += elapsed * has_command
        travel = np.array([self._sent, positions])
        self._least, self._most = np.minimum(self._least, travel), np.maximum(self._most, travel)
        commanded_range, measured_range = self._most - self._least
        # Drives cannot follow oscillations that are faster than their settling time.
        is_slow = commanded_range * self._active >= 0.5 * SETTLING_TIME * self._path
        is_far = commanded_range >= MIN_SPEED * FAILURE_TIME
        is_long = self._active >= self.failure_time - SETTLING_TIME
        ready = is_slow & is_far & is_long & np.isnan(self._asked)
        self._asked[ready], self._asked_at[ready] = commanded_range[ready], time
        is_settled = time - self._asked_at >= SETTLING_TIME
        due = is_settled & (self._active >= self.failure_time) & ~np.isnan(self._asked)
        stuck = due & (measured_range < MIN_SHARE * self._asked)
        self.failed |= {self._names[i] for i in np.flatnonzero(stuck)}
        works = measured_range >= MIN_SHARE * commanded_range
        self._restart(due | (works & (commanded_range >= EVIDENT_TRAVEL)), travel)

    def _restart(self, which: Flags | slice, travel: Array) -> None:
        self._active[which] = self._path[which] = 0.0
        self._asked[which] = np.nan
        self._least[:, which] = self._most[:, which] = travel[:, which]
