# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Detect rollers that have failed: commanded, and not moving for a stated time.

The commanded travel of a roller is compared with the measured one, both as ranges, the largest
less the smallest. The motion may lag, so delays between command and motion do no harm; neither do
commands that oscillate, and noise that does not grow with time.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from isotruss_ros.core.model.topology import check_roller_names
from isotruss_ros.core.numerics.arrays import Array, Flags
import numpy as np

#: A roller that is commanded for this long without moving has failed [s].
FAILURE_TIME = 1.0
#: Slower commands do not count: friction may hold the rollers [m/s].
MIN_SPEED = 0.002
#: Nor does a commanded range of travel below this [m].
MIN_TRAVEL = 0.002
#: Nor a range below the travel in this time at the mean commanded speed: drives need not follow
#: such oscillations [s].
MIN_SWING = 0.1
#: A roller that moved over this share of the commanded range works [-].
MIN_SHARE = 0.25
#: Rollers follow commands within this time [s].
SETTLING_TIME = 0.2
#: A roller that works after a commanded range of this is timed again [m].
EVIDENT_TRAVEL = 0.02
#: Samples further apart than this, or running back, are no evidence [s].
MAX_GAP = 0.5


class _Range:
    """Smallest and largest of numbers that change, (r,) each, since each was last reset."""

    def __init__(self, count: int) -> None:
        self.least, self.most = np.zeros(count), np.zeros(count)

    def begin(self, which: Flags, at: Array) -> None:
        self.least[which] = self.most[which] = at[which]

    def take(self, values: Array) -> None:
        np.minimum(self.least, values, out=self.least)
        np.maximum(self.most, values, out=self.most)

    @property
    def size(self) -> Array:
        return self.most - self.least


class FailureDetector:
    """
    Compares commands and travel of the rollers.

    A roller that is not commanded is never flagged. One that is flagged stays so until it is
    reset: held at zero, it cannot show that it works.

    :ivar failed: names of the rollers that have failed.
    :ivar failure_time: see below; may change at any time.
    :param names: of the rollers.
    :param failure_time: commanded for this long without moving, a roller has failed [s].
    """

    def __init__(self, names: Sequence[str], failure_time: float = FAILURE_TIME) -> None:
        count = len(names)
        self.failed: frozenset[str] = frozenset()
        self.failure_time = failure_time
        self._names = tuple(names)
        self._time: float | None = None
        self._sent = np.zeros(count)  # travel that was commanded [m]
        self._commanded = np.zeros(count)  # time with a command since the roller last moved [s]
        self._path = np.zeros(count)  # commanded path length in that time [m]
        self._asked = np.full(count, np.nan)  # range to compare with; nan while there is none [m]
        self._asked_at = np.zeros(count)  # the time when that range was commanded [s]
        self._sent_range, self._moved_range = _Range(count), _Range(count)

    def reset(self, names: Collection[str] | None = None) -> None:
        """
        Take rollers for working again, and compare them from now on.

        :param names: which; all of them when left out.
        :raises GraspError: there is no such roller.
        """
        cleared = frozenset(self._names if names is None else names)
        check_roller_names('rollers', cleared, self._names)
        self.failed -= cleared
        self._time = None

    def update(self, positions: Array, time: float, commanded: Array) -> None:
        """
        Compare a sample of the rollers' travel with what was commanded.

        :param positions: (r,) travel [m].
        :param time: of the sample; one with the time of the sample before is ignored [s].
        :param commanded: (r,) speeds that were commanded since the sample before [m/s].
        """
        if time == self._time:
            return
        elapsed = time - self._time if self._time is not None else -1.0
        self._time = time
        if not 0.0 < elapsed <= MAX_GAP:
            self._begin(np.ones(len(self._names), dtype=bool), positions)
            return
        counts = np.abs(commanded) >= MIN_SPEED
        step = elapsed * np.where(counts, commanded, 0.0)
        self._sent += step
        self._path += np.abs(step)
        self._commanded += elapsed * counts
        self._sent_range.take(self._sent)
        self._moved_range.take(positions)
        self._judge(time, positions)

    def _judge(self, time: float, positions: Array) -> None:
        """Flag the rollers that have failed, and time again those that work."""
        sent, moved = self._sent_range.size, self._moved_range.size
        timed = (sent >= EVIDENT_TRAVEL) & (moved >= MIN_SHARE * sent)
        long = self._commanded >= self.failure_time - SETTLING_TIME
        if long.any():
            timed |= self._flag(long, sent, moved, time)
        if timed.any():
            self._begin(timed, positions)

    def _flag(self, long: Flags, sent: Array, moved: Array, time: float) -> Flags:
        """Flag those that have failed, of the rollers with a long command; return who is due."""
        swing = MIN_SWING * self._path
        far = (sent >= MIN_TRAVEL) & (sent * self._commanded >= swing)
        ready = long & far & np.isnan(self._asked)
        self._asked[ready], self._asked_at[ready] = sent[ready], time
        settled = time - self._asked_at >= SETTLING_TIME
        due = ~np.isnan(self._asked) & settled & (self._commanded >= self.failure_time)
        stuck = due & (moved < MIN_SHARE * self._asked)
        if stuck.any():
            self.failed |= {self._names[i] for i in np.flatnonzero(stuck)}
        return due

    def _begin(self, which: Flags, positions: Array) -> None:
        self._commanded[which] = self._path[which] = 0.0
        self._asked[which] = np.nan
        self._sent_range.begin(which, self._sent)
        self._moved_range.begin(which, positions)
