"""The roller speeds that were commanded lately, to predict travel since an old measurement."""

from __future__ import annotations

from bisect import bisect_right

from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Old entries are dropped in lots of about this many.
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

    def _until(self, time: float) -> Array:
        place = bisect_right(self._times, time) - 1
        return self._travel[place] + (time - self._times[place]) * self._speeds[place]
