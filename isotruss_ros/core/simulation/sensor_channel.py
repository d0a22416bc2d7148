# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What comes of a quantity by way of a sensor: sampled, noisy, rounded, late, or not at all."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
import math
from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array
import numpy as np
from numpy.typing import ArrayLike

#: Times that differ by less are the same, such as sums of periods [s].
SAME_TIME = 1e-6


@dataclass(frozen=True)
class SensorFaults:
    """
    How a sensor differs from a perfect one.

    :ivar rate: measurements in a second, at most one a call; 0 for one in every call [Hz].
    :ivar delay: a measurement arrives so long after it was taken [s].
    :ivar dropouts: share of the rows that never arrive, 0 to 1.
    :ivar noise: standard deviation, one for all or by value of a row [unit of the values].
    :ivar step: values are rounded to multiples of it, likewise; 0 does not round.
    """

    rate: float = 0.0
    delay: float = 0.0
    dropouts: float = 0.0
    noise: ArrayLike = 0.0
    step: ArrayLike = 0.0


class Measurement(NamedTuple):
    """
    What arrived from a sensor.

    :ivar time: when it was taken [s].
    :ivar values: (k, n) measured, in rows that arrive or are lost as a whole.
    :ivar seen: (k,) whether the row arrived; one did at least.
    """

    time: float
    values: Array
    seen: Array


class SensorChannel:
    """
    The measurements of one sensor on their way.

    :ivar faults: of the sensor; may change at any time.
    :param faults: of the sensor.
    :param seed: of noise and dropouts: a number, or several; not negative.
    """

    def __init__(self, faults: SensorFaults, seed: int | Sequence[int] = 0) -> None:
        self.faults = faults
        self._random = np.random.default_rng(seed)
        self._due = -math.inf
        self._under_way: deque[Measurement] = deque()

    def measure(self, time: float, read: Callable[[], ArrayLike]) -> list[Measurement]:
        """
        Measure where it is time to, and return what arrives by now, the oldest first.

        A time before that of the last call drops what is under way.

        :param time: now [s].
        :param read: returns the true values (k, n); called only where they are measured.
        """
        waiting = self._under_way
        if waiting and waiting[-1].time > time:
            waiting.clear()
        if self._is_due(time):
            values = np.atleast_2d(np.asarray(read(), dtype=float))
            # Drawn always, so that the noise of a seed does not depend on the dropouts.
            noise, lost = self._random.normal(size=values.shape), self._random.random(len(values))
            measured, step = values + self.faults.noise * noise, np.asarray(self.faults.step)
            unit = np.where(step > 0.0, step, 1.0)
            measured = np.where(step > 0.0, unit * np.round(measured / unit), measured)
            seen = lost >= self.faults.dropouts
            if seen.any():
                waiting.append(Measurement(time, measured, seen))
        arrived = []
        while waiting and waiting[0].time + self.faults.delay <= time + SAME_TIME:
            arrived.append(waiting.popleft())
        return arrived

    def _is_due(self, time: float) -> bool:
        """Return whether to measure now; the mean rate is kept where calls come between."""
        if self.faults.rate == 0.0:
            return True
        period, late = 1.0 / self.faults.rate, time - self._due
        if -period <= late < -SAME_TIME:
            return False
        self._due = self._due + period if 0.0 <= late + SAME_TIME < period else time + period
        return True
