"""
Tell which rollers have failed: commanded, and not moving for a stated time.

What counts is how far a roller was sent against how far it came, both as ranges, the largest less
the smallest. It has a while to come there, so delays between command and motion do no harm;
neither do commands that swing to and fro, and noise that does not grow with time.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from isotruss_ros.core.errors import GraspError
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FailureCriterion:
    """
    When a roller has failed.

    :ivar time: commanded for this long without moving [s].
    :ivar min_speed: slower commands do not count: friction may hold them [m/s].
    :ivar min_travel: nor do commands that send it over less than this, to and fro [m].
    :ivar min_swing: nor those that send it over less than it goes in this time at the mean speed,
        which drives need not follow [s].
    :ivar min_share: who came this share of the way that it was sent has moved.
    :ivar settling: rollers follow commands within this time [s].
    :ivar evident: sent over this and moved, it works, and the time begins anew [m].
    :ivar max_gap: samples further apart than this, or running back, say nothing [s].
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
    """Smallest and largest of numbers that change, (r,) each, since each last began."""

    def __init__(self, count: int) -> None:
        self.least, self.most = np.zeros(count), np.zeros(count)

    def begin(self, which: NDArray[np.bool_], at: Array) -> None:
        self.least[which] = self.most[which] = at[which]

    def take(self, values: Array) -> None:
        np.minimum(self.least, values, out=self.least)
        np.maximum(self.most, values, out=self.most)

    @property
    def size(self) -> Array:
        return self.most - self.least


class FailureDetector:
    """
    Watches commands and travel of the rollers.

    A roller that is not commanded is never accused. One that was found to have failed stays so
    until somebody says otherwise: held at zero, it cannot show that it works.

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
        self._commanded = np.zeros(count)  # time for which it was, since the roller last moved [s]
        self._path = np.zeros(count)  # travel to and fro in that time [m]
        self._asked = np.full(count, np.nan)  # range to be judged by; nan while there is none [m]
        self._asked_at = np.zeros(count)  # the time when it had been sent over that [s]
        self._sent_range, self._moved_range = _Range(count), _Range(count)

    def forgive(self, names: Collection[str] | None = None) -> None:
        """
        Take rollers for working again, and watch them from now on.

        :param names: which; all of them when left out.
        :raises GraspError: there is no such roller.
        """
        forgiven = frozenset(self._names if names is None else names)
        unknown = forgiven - set(self._names)
        if unknown:
            raise GraspError(
                f'rollers {", ".join(sorted(map(repr, unknown)))}: the robot has no such rollers; '
                f'its rollers are {", ".join(self._names)}'
            )
        self.failed -= forgiven
        self._time = None

    def update(self, positions: Array, time: float, commanded: Array) -> None:
        """
        Take a sample of the rollers' travel.

        :param positions: (r,) travel [m].
        :param time: for which it holds; no news where it is that of the sample before [s].
        :param commanded: (r,) speeds that the rollers were told since that [m/s].
        """
        if time == self._time:
            return
        everyone = np.ones(len(self._names), dtype=bool)
        elapsed = time - self._time if self._time is not None else -1.0
        self._time = time
        if not 0.0 < elapsed <= self.criterion.max_gap:
            self._begin(everyone, positions)
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
        """Tell who has failed and who works, among those for whom that can be told."""
        criterion, sent, moved = self.criterion, self._sent_range.size, self._moved_range.size
        long = self._commanded >= max(criterion.time - criterion.settling, 0.0)
        swing = criterion.min_swing * self._path
        far = (sent >= criterion.min_travel) & (sent * self._commanded >= swing)
        ready = long & far & np.isnan(self._asked)
        self._asked[ready], self._asked_at[ready] = sent[ready], time
        settled = time - self._asked_at >= criterion.settling
        due = ~np.isnan(self._asked) & settled & (self._commanded >= criterion.time)
        stuck = due & (moved < criterion.min_share * self._asked)
        if stuck.any():
            self.failed |= {self._names[i] for i in np.flatnonzero(stuck)}
        works = (sent >= criterion.evident) & (moved >= criterion.min_share * sent)
        if due.any() or works.any():
            self._begin(due | works, positions)

    def _begin(self, which: NDArray[np.bool_], positions: Array) -> None:
        self._commanded[which] = self._path[which] = 0.0
        self._asked[which] = np.nan
        self._sent_range.begin(which, self._sent)
        self._moved_range.begin(which, positions)
