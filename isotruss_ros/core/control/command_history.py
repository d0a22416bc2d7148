# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Commands that were sent: with them the travel since an old measurement is predicted."""

from __future__ import annotations

from bisect import bisect_right

from isotruss_ros.core.control.inputs import StampedInput
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Old commands are dropped in lots of about this many.
LOT = 64


class CommandHistory:
    """
    Commanded roller speeds, each from its time until the next.

    :ivar last: (r,) speeds that were commanded last [m/s]; None where nothing is recorded.
    :param count: number of rollers.
    """

    def __init__(self, count: int) -> None:
        self._count = count
        self.clear()

    def clear(self) -> None:
        """Drop all entries."""
        self.last: Array | None = None
        self._times: list[float] = []
        self._speeds: list[Array] = []
        self._travel: list[Array] = []  # commanded until each of the times, from any start [m]

    def discard_old(self, now: float, span: float) -> None:
        """
        Drop old entries; all where the clock ran back, or the last one is older than the span.

        :param now: time on the clock of the entries [s].
        :param span: how far back entries are needed [s].
        """
        if not self._times:
            return
        if not 0.0 <= now - self._times[-1] <= span:
            self.clear()
        elif len(self._times) > LOT:
            old = bisect_right(self._times, now - span) - 1
            if old >= LOT:
                del self._times[:old], self._speeds[:old], self._travel[:old]

    def record(self, now: float, speeds: Array) -> None:
        """
        Record a command.

        :param now: not before that of the last entry [s].
        :param speeds: (r,) [m/s].
        """
        travel = self._until(now) if self._times else np.zeros(self._count)
        self.last = speeds
        self._times.append(now)
        self._speeds.append(speeds)
        self._travel.append(travel)

    def travel(self, begin: float, end: float, before: Array) -> Array:
        """
        Return the roller travel that was commanded between two times (r,) [m].

        :param begin: [s].
        :param end: the travel is negative where that is earlier [s].
        :param before: (r,) speeds at times before the first entry [m/s].
        """
        if not self._times:
            return (end - begin) * before
        first = self._times[0]
        if begin >= first and end >= first:
            return self._until(end) - self._until(begin)
        unknown = min(end, first) - min(begin, first)
        return self._until(max(end, first)) - self._until(max(begin, first)) + unknown * before

    def expected_travel(
        self, rollers: StampedInput, then: float, now: float, ahead: float, still: Array
    ) -> tuple[Array, Array, Array]:
        """
        Return how far the rollers travel after their measurement.

        They follow the commands. Measured speeds count for the time before the first one, when
        another client may have moved them.

        :param rollers: the measured `RollerState`.
        :param then: a time in between [s].
        :param now: time on the clock of the entries [s].
        :param ahead: for so long after now [s].
        :param still: (r,) whether each roller does not follow commands.
        :return: (r,) each: travel until then, until the end [m], and the speeds with which they
            get from now to there [m/s].
        """
        measured = rollers.value.velocities
        last = np.where(still, 0.0, measured if self.last is None else self.last)
        before = np.zeros(self._count)
        if then != rollers.time:
            before = np.where(still, 0.0, self.travel(rollers.time, then, measured))
        travel = np.where(still, 0.0, self.travel(rollers.time, now, measured))
        return before, travel + ahead * last, last

    def _until(self, time: float) -> Array:
        place = bisect_right(self._times, time) - 1
        return self._travel[place] + (time - self._times[place]) * self._speeds[place]
