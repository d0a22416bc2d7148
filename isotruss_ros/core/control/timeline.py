# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Values at increasing times, and between them."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from operator import itemgetter

from isotruss_ros.core.numerics.arrays import Array


class Timeline:
    """A quantity, a number or an array, that changes evenly from each known time to the next."""

    def __init__(self) -> None:
        self._known: deque[tuple[float, float | Array]] = deque()

    def __bool__(self) -> bool:
        """Return whether a value is known."""
        return bool(self._known)

    @property
    def first(self) -> tuple[float, float | Array]:
        """Return the first time that is kept [s] and the value then."""
        return self._known[0]

    @property
    def last(self) -> tuple[float, float | Array]:
        """Return the last time [s] and the value then."""
        return self._known[-1]

    @property
    def values(self) -> list[float | Array]:
        """Return the values that are kept, in order."""
        return [value for _, value in self._known]

    def add(self, time: float, value: float | Array) -> None:
        """
        Add a value, which takes the place of those at that time and later.

        :param time: [s].
        :param value: then.
        """
        while self._known and self._known[-1][0] >= time:
            self._known.pop()
        self._known.append((time, value))

    def discard_before(self, time: float) -> None:
        """
        Drop what tells nothing of a time and later.

        :param time: [s].
        """
        while len(self._known) > 1 and self._known[1][0] <= time:
            self._known.popleft()

    def at(self, time: float) -> float | Array:
        """
        Return the value at a time; before the first it is the first, and after the last the last.

        :param time: [s].
        """
        after = bisect_right(self._known, time, key=itemgetter(0))
        if after in (0, len(self._known)):
            return self._known[min(after, len(self._known) - 1)][1]
        (start, value), (end, following) = self._known[after - 1], self._known[after]
        return value + (time - start) / (end - start) * (following - value)
