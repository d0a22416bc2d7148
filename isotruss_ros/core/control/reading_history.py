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
from collections import deque
from operator import itemgetter

from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Readings are kept for so long [s].
SPAN = 1.0
#: What is asked for may be ahead of the last reading by this [s].
AHEAD = 0.05


class ReadingHistory:
    """The readings of the last while, at least one after the first."""

    def __init__(self) -> None:
        self._kept: deque[tuple[float, Array]] = deque()

    @property
    def last(self) -> tuple[float, Array] | None:
        """Return time [s] and reading (r,) [m] of the last; None before the first."""
        return self._kept[-1] if self._kept else None

    def add(self, time: float, readings: Array) -> None:
        """
        Keep a reading.

        :param time: later than that of the last [s].
        :param readings: (r,) roller travel since home [m].
        """
        self._kept.append((time, np.array(readings, dtype=float)))
        while len(self._kept) > 1 and self._kept[1][0] <= time - SPAN:
            self._kept.popleft()

    def at(self, time: float) -> Array | None:
        """
        Return the reading at a time (r,), between two of them [m].

        :param time: [s].
        :return: None where that is too long ago, or in the future.
        """
        kept = self._kept
        if not kept or not kept[0][0] <= time <= kept[-1][0] + AHEAD:
            return None
        after = bisect_right(kept, time, key=itemgetter(0))
        if after == len(kept):
            return kept[-1][1]
        (start, first), (end, second) = kept[after - 1], kept[after]
        return first + (time - start) / (end - start) * (second - first)

    @property
    def spread(self) -> Array:
        """Return by how much the readings differ (r,) [m]."""
        return np.ptp([reading for _, reading in self._kept], axis=0)
