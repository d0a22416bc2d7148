# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What the first contact of each member tells while two close on a free object.

The object lies. From when the first member pushes it along, that member's line is tangent to it:
its depth in the member is zero. From when that depth grows, the other member presses as well, and
about as deep.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
import math
from typing import NamedTuple

from isotruss_ros.core.control.belief import Belief
from isotruss_ros.core.model.pose import pose_difference
from isotruss_ros.core.numerics.arrays import Array
import numpy as np
import scipy

#: The mean of so many of the last poses is compared with those before.
WINDOW = 5
#: An object that moves so seldom does not lie still, a depth does not stay zero: probabilities.
MOVES, LEAVES = 1e-6, 1e-4
#: It is pushed by a member against whose normal it goes, by this share of its way.
AGAINST = 0.7
#: An object that lies still while a member comes nearer by this is not held [m].
NEARER = 5e-3
#: Error of a tangent [m]; how far two depths in tubes differ, as a share of them.
TANGENT, UNEVEN = 1e-3, 0.5


class Told(NamedTuple):
    """
    What is zero.

    :ivar value: what it is in a state (n,).
    :ivar rates: (n,) its derivatives.
    :ivar variance: of its error.
    """

    value: float
    rates: Array
    variance: float


class Seen(NamedTuple):
    """
    An object that was measured.

    :ivar pose: (x, y, angle) [m, rad].
    :ivar variances: (3,) of that.
    :ivar readings: (r,) of the encoders then [m].
    :ivar mean: (n,) state in which the depths are.
    :ivar depths: (m,) how deep it is in the undeformed members of a grip [m].
    :ivar rates: (m, n) derivatives of these by the estimated state.
    :ivar by_pose: (m, 3) derivatives by the pose.
    """

    pose: Array
    variances: Array
    readings: Array
    mean: Array
    depths: Array
    rates: Array
    by_pose: Array

    def told(self, weights: Array, mean: Array) -> Told:
        """
        Return the weighted sum of the depths.

        :param weights: (m,).
        :param mean: (n,) state in which that is wanted.
        """
        rates, by_pose = weights @ self.rates, weights @ self.by_pose
        value = weights @ self.depths + rates @ (mean - self.mean)
        return Told(float(value), rates, float(by_pose**2 @ self.variances))


class FirstContact:
    """
    Follows an object that lies, and is pushed, until both members press.

    :ivar lies: whether it was seen to lie while members came nearer.
    """

    def __init__(self) -> None:
        self.lies = False
        self._wait()

    def _wait(self) -> None:
        """Begin to look where it lies."""
        self._window: deque[Seen] = deque()
        self._first: Seen | None = None
        self._rest, self._count = np.zeros(3), 0
        self._pusher: int | None = None
        self._ratio, self._told = 1.0, 0

    def take(self, seen: Seen, belief: Belief, press: Callable[[], Array]) -> Told | None:
        """
        Take a measurement in, and return what contacts tell; None where they tell nothing new.

        :param seen: later than the last.
        :param belief: of the state.
        :param press: returns how deep the object is in each member (m,) where both press [m].
        """
        if len(seen.depths) != 2:
            return None
        self._window.append(seen)
        if len(self._window) <= WINDOW:
            return None
        oldest = self._window.popleft()
        if self._pusher is None:
            self._look_for_push(oldest)
            if self._pusher is not None:
                depths = press()
                self._ratio = float(depths[self._pusher] / depths[1 - self._pusher])
            return None
        return self._follow_push(oldest, belief)

    def _look_for_push(self, oldest: Seen) -> None:
        """Notice that the object moves, and which member pushes it."""
        first = self._first = self._first or oldest
        self._count += 1
        self._rest = (
            self._rest + (pose_difference(oldest.pose, first.pose) - self._rest) / self._count
        )
        last = self._window[-1]
        moved = (
            np.mean([pose_difference(each.pose, first.pose) for each in self._window], axis=0)
            - self._rest
        )
        variances = last.variances * (1.0 / WINDOW + 1.0 / self._count)
        nearer = last.rates[:, : len(last.readings)] @ (last.readings - first.readings)
        if (moved**2 / variances).sum() <= scipy.special.chdtri(3, MOVES):
            self.lies = self.lies or bool(nearer.max() > NEARER)
            return
        along = last.by_pose @ moved
        pusher = int(along.argmin())
        pushed = along[pusher] < -AGAINST * math.hypot(*moved[:2]) and nearer[pusher] > 0.0
        self._wait()
        if pushed:
            self._pusher = pusher

    def _follow_push(self, oldest: Seen, belief: Belief) -> Told | None:
        """Return that it is as deep in the member that pushes it as in the other, if in that."""
        depth = self._less_deep(self._window, belief)
        spread = float(belief.spread(depth.rates[None])[0, 0]) + depth.variance
        if depth.value**2 > spread * scipy.special.chdtri(1, LEAVES):
            self._wait()  # it is not pushed by this member any more
            return None
        self._told += 1
        return self._less_deep([oldest], belief, self._told)

    def _less_deep(self, seen: Iterable[Seen], belief: Belief, count: int = 1) -> Told:
        """Return the mean of how deep it is in the member that pushes, less that in the other."""
        mine = np.eye(2)[self._pusher]
        means = []
        for weights in (mine, self._ratio * (1.0 - mine)):
            told = [each.told(weights, belief.mean) for each in seen]
            value = float(np.mean([each.value for each in told]))
            means.append(Told(value, told[-1].rates, told[-1].variance / len(told)))
        return _less(*means, belief, count)  # type: ignore[call-arg, arg-type]


def _less(mine: Told, other: Told, belief: Belief, count: int) -> Told:
    """
    Return a depth less another one, which counts where it is positive: by its moments.

    Of a normal d with density p and distribution P at d / s: E max(d, 0) = d P + s p, and what
    it has in common with d is P.
    """
    variance = float(belief.spread(other.rates[None])[0, 0]) + other.variance
    deviation = math.sqrt(variance)
    at = other.value / deviation
    share = float(scipy.special.ndtr(at))
    mean = other.value * share + deviation * math.exp(-0.5 * at**2) / math.sqrt(2.0 * math.pi)
    square = (other.value**2 + variance) * share + other.value * (mean - other.value * share)
    left = max(square - mean**2 - share**2 * variance, 0.0)
    more = share**2 * other.variance + count * (left + TANGENT**2 + (UNEVEN * mean) ** 2)
    return Told(mine.value - mean, mine.rates - share * other.rates, mine.variance + more)
