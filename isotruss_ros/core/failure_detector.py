"""
Tell which rollers have failed: commanded, and not moving for a stated time.

What counts is how far a roller was sent against how far it came, both as ranges, the largest less
the smallest. A delay between command and motion, commands that swing to and fro, and noise that
does not grow with time leave ranges as they are.
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

    :ivar time: commanded for this long without moving; infinite for never [s].
    :ivar min_speed: slower commands do not count: friction may hold them [m/s].
    :ivar min_travel: nor do commands that send it over less than this, to and fro [m].
    :ivar min_share: who came this share of the way that it was sent has moved.
    :ivar max_gap: samples further apart than this, or running back, say nothing [s].
    """

    time: float = 1.0
    min_speed: float = 0.002
    min_travel: float = 0.02
    min_share: float = 0.25
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
        self._sent += elapsed * np.where(counts, commanded, 0.0)
        self._commanded += elapsed * counts
        self._sent_range.take(self._sent)
        self._moved_range.take(positions)
        sent = self._sent_range.size
        enough = sent >= self.criterion.min_travel
        moved = self._moved_range.size >= self.criterion.min_share * sent
        stuck = enough & ~moved & (self._commanded >= self.criterion.time)
        if stuck.any():
            self.failed |= {self._names[i] for i in np.flatnonzero(stuck)}
        self._begin(enough & moved, positions)

    def _begin(self, which: NDArray[np.bool_], positions: Array) -> None:
        self._commanded[which] = 0.0
        self._sent_range.begin(which, self._sent)
        self._moved_range.begin(which, positions)
