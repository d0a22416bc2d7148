# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Readings of the encoders of the last while, by the time at which they were taken."""

from __future__ import annotations

from bisect import bisect_right

from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Readings are kept for so long [s].
SPAN = 1.0
#: What is asked for may be ahead of the last reading by this [s].
AHEAD = 0.05


class ReadingHistory:
    """The readings of the last while, at least one after the first."""

    def __init__(self) -> None:
        self._times: list[float] = []
        self._readings: list[Array] = []

    @property
    def last(self) -> tuple[float, Array] | None:
        """Return time [s] and reading (r,) [m] of the last; None before the first."""
        return (self._times[-1], self._readings[-1]) if self._times else None

    def add(self, time: float, readings: Array) -> None:
        """
        Keep a reading.

        :param time: later than that of the last [s].
        :param readings: (r,) roller travel since home [m].
        """
        self._times.append(time)
        self._readings.append(np.array(readings, dtype=float))
        old = bisect_right(self._times, time - SPAN)
        if 2 * old > len(self._times):
            del self._times[:old], self._readings[:old]

    def at(self, time: float) -> Array | None:
        """
        Return the reading at a time (r,), between two of them [m].

        :param time: [s].
        :return: None where that is too long ago, or in the future.
        """
        times = self._times
        if not times or not times[0] <= time <= times[-1] + AHEAD:
            return None
        after = bisect_right(times, time)
        if after == len(times):
            return self._readings[-1]
        start, end = times[after - 1], times[after]
        first, second = self._readings[after - 1], self._readings[after]
        return first + (time - start) / (end - start) * (second - first)

    @property
    def spread(self) -> Array:
        """Return by how much the readings differ (r,) [m]."""
        return np.ptp(np.array(self._readings), axis=0)
