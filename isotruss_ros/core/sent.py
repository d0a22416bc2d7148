"""How far the rollers were sent: what tells where they are by now when a measurement is old."""

from __future__ import annotations

from bisect import bisect_right

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Old entries are dropped in lots of about this many.
LOT = 64


class SentSpeeds:
    """
    The speeds that rollers were told lately, each from its time until the next.

    :param count: of the rollers.
    """

    def __init__(self, count: int) -> None:
        self._count = count
        self.forget()

    def forget(self) -> None:
        """Know of nothing that was sent."""
        self._times: list[float] = []
        self._speeds: list[Array] = []
        self._travel: list[Array] = []  # sent until each of the times, from any beginning [m]

    @property
    def last(self) -> Array | None:
        """Return the speeds (r,) that were sent last [m/s], None where nothing is known."""
        return self._speeds[-1] if self._speeds else None

    def keep(self, now: float, span: float) -> None:
        """
        Forget what is of no use: all where the clock ran back, or nothing was sent for so long.

        :param now: time on the clock of what was noted [s].
        :param span: how far back it is wanted [s].
        """
        if not self._times:
            return
        if not 0.0 <= now - self._times[-1] <= span:
            self.forget()
        elif len(self._times) > LOT:
            old = bisect_right(self._times, now - span) - 1
            if old >= LOT:
                del self._times[:old], self._speeds[:old], self._travel[:old]

    def note(self, now: float, speeds: Array) -> None:
        """
        Take down what is sent.

        :param now: not before what was noted last [s].
        :param speeds: (r,) [m/s].
        """
        travel = self._until(now) if self._times else np.zeros(self._count)
        self._times.append(now)
        self._speeds.append(speeds)
        self._travel.append(travel)

    def travel(self, begin: float, end: float, before: Array) -> Array:
        """
        Return how far the rollers were sent from one time to another (r,) [m].

        :param begin: [s].
        :param end: the travel is negative where that is earlier [s].
        :param before: (r,) speeds at times before anything that is known was sent [m/s].
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
