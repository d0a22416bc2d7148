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
        self._commanded = np.zeros(count)  # commanded travel [m]
        self._duration = np.zeros(count)  # time with a command since the last restart [s]
        self._path = np.zeros(count)  # commanded path length in that time [m]
        # Commanded range with which the measured range is compared after the settling time [m],
        # and time at which it was set [s]; nan: none.
        self._required, self._required_at = np.full((2, count), np.nan)
        # Minimum and maximum of commanded and measured travel (2, r) since the last restart [m].
        self._minimum, self._maximum = np.zeros((2, 2, count))

    def reset(self, names: Collection[str] | None = None) -> None:
        """Regard some or all rollers as working again, and restart the comparison for all."""
        cleared = frozenset(self._names if names is None else names)
        check_names('rollers', cleared, self._names)
        self.failed -= cleared
        self._time = math.nan

    def update(self, positions: Array, time: float, speeds: Array) -> None:
        """Compare measured travel (r,) [m] with the mean commanded speeds since the last call."""
        elapsed, self._time = time - self._time, time
        if elapsed == 0.0:
            return
        # After samples that are out of order or far apart, the comparison restarts.
        if not 0.0 < elapsed <= FAILURE_TIME:
            self._restart(slice(None), np.array([self._commanded, positions]))
            return
        # Commanded path, and ranges of commanded and measured travel since the restart.
        has_command = np.abs(speeds) >= MIN_SPEED
        step = elapsed * np.where(has_command, speeds, 0.0)
        self._commanded += step
        self._path += np.abs(step)
        self._duration += elapsed * has_command
        travel = np.array([self._commanded, positions])
        self._minimum = np.minimum(self._minimum, travel)
        self._maximum = np.maximum(self._maximum, travel)
        commanded_range, measured_range = self._maximum - self._minimum
        # The present commanded range is compared with the measured one after the settling time.
        # Drives cannot follow oscillations that are faster than this time.
        is_slow = commanded_range * self._duration >= 0.5 * SETTLING_TIME * self._path
        is_far = commanded_range >= MIN_SPEED * FAILURE_TIME
        is_long = self._duration >= self.failure_time - SETTLING_TIME
        is_new = is_slow & is_far & is_long & np.isnan(self._required_at)
        self._required[is_new], self._required_at[is_new] = commanded_range[is_new], time
        # Failed rollers, and those that evidently work; the comparison restarts for both.
        is_settled = time - self._required_at >= SETTLING_TIME
        is_due = is_settled & (self._duration >= self.failure_time)
        is_stuck = is_due & (measured_range < MIN_SHARE * self._required)
        self.failed |= {self._names[i] for i in np.flatnonzero(is_stuck)}
        follows = measured_range >= MIN_SHARE * commanded_range
        self._restart(is_due | (follows & (commanded_range >= EVIDENT_TRAVEL)), travel)

    def _restart(self, rollers: Flags | slice, travel: Array) -> None:
        """Restart the comparison of some rollers at commanded and measured travel (2, r) [m]."""
        self._duration[rollers] = self._path[rollers] = 0.0
        self._required_at[rollers] = np.nan
        self._minimum[:, rollers] = self._maximum[:, rollers] = travel[:, rollers]
