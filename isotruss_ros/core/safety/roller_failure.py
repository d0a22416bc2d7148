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
from dataclasses import dataclass

from isotruss_ros.core.model.topology import check_roller_names
from isotruss_ros.core.numerics.arrays import Array, Flags
import numpy as np


@dataclass(frozen=True)
class FailureCriterion:
    """
    When a roller has failed.

    :ivar time: commanded for this long without moving [s].
    :ivar min_speed: slower commands do not count: friction may hold them [m/s].
    :ivar min_travel: nor does a commanded range of travel below this [m].
    :ivar min_swing: nor a range below what the roller travels in this time at the mean commanded
        speed: drives need not follow such oscillations [s].
    :ivar min_share: a roller that moved over this share of the commanded range works.
    :ivar settling: rollers follow commands within this time [s].
    :ivar evident: a roller that works after a commanded range of this is timed again [m].
    :ivar max_gap: samples further apart than this, or running back, are no evidence [s].
    """

    time: float = 1.0
    min_speed: float = 0.002
    min_travel: float = 0.002
    min_swing: float = 0.1
    min_share: float = 0.25
    settling: float = 0.2
    evident: float = 0.02
    max_gap: float = 0.5


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
    :param names: of the rollers.
    :param criterion: when one has failed.
    """

    def __init__(self, names: Sequence[str], criterion: FailureCriterion) -> None:
        count = len(names)
        self.failed: frozenset[str] = frozenset()
        self.criterion = criterion
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
        if not 0.0 < elapsed <= self.criterion.max_gap:
            self._begin(np.ones(len(self._names), dtype=bool), positions)
            return
        counts = np.abs(commanded) >= self.criterion.min_speed
        step = elapsed * np.where(counts, commanded, 0.0)
        self._sent += step
        self._path += np.abs(step)
        self._commanded += elapsed * counts
        self._sent_range.take(self._sent)
        self._moved_range.take(positions)
        self._judge(time, positions)

    def _judge(self, time: float, positions: Array) -> None:
        """Flag the rollers that have failed, and time again those that work."""
        criterion, sent, moved = self.criterion, self._sent_range.size, self._moved_range.size
        timed = (sent >= criterion.evident) & (moved >= criterion.min_share * sent)
        long = self._commanded >= criterion.time - criterion.settling
        if long.any():
            timed |= self._flag(long, sent, moved, time)
        if timed.any():
            self._begin(timed, positions)

    def _flag(self, long: Flags, sent: Array, moved: Array, time: float) -> Flags:
        """Flag those that have failed, of the rollers with a long command; return who is due."""
        criterion = self.criterion
        swing = criterion.min_swing * self._path
        far = (sent >= criterion.min_travel) & (sent * self._commanded >= swing)
        ready = long & far & np.isnan(self._asked)
        self._asked[ready], self._asked_at[ready] = sent[ready], time
        settled = time - self._asked_at >= criterion.settling
        due = ~np.isnan(self._asked) & settled & (self._commanded >= criterion.time)
        stuck = due & (moved < criterion.min_share * self._asked)
        if stuck.any():
            self.failed |= {self._names[i] for i in np.flatnonzero(stuck)}
        return due

    def _begin(self, which: Flags, positions: Array) -> None:
        self._commanded[which] = self._path[which] = 0.0
        self._asked[which] = np.nan
        self._sent_range.begin(which, self._sent)
        self._moved_range.begin(which, positions)
