# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of the grip of a regulated object, and its oscillations."""

from __future__ import annotations

import enum
import math

from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Half-swings of the pose error from this size on count [m], and from this many times the noise
#: where that is more ...
SWING, NOISES = 0.002, 4.0
#: ... where they take less than so many times pi / omega, or this time if that is not known [s].
SLOWEST, SWING_TIME = 2.0, 0.5
#: So many half-swings, each at least so large against the one before it, do not decay.
SWINGS, NO_DECAY = 3, 0.95
#: Low-pass on the pose error where omega is not known, else 1 / omega [s].
FILTER_TIME = 0.05


class GripFault(enum.Enum):
    """What is wrong with the grip."""

    SLIPPED = 'slipped'
    NOT_HELD = 'not held'
    OSCILLATES = 'oscillates'

    @property
    def halt(self) -> Status:
        """Return the status in this fault."""
        return Status[f'HALT_{self.name}']


class SwingWatch:
    """
    Detects oscillations of a held object that grow or do not decay.

    :param frequency: lowest natural frequency of the held object; None if not known [rad/s].
    """

    def __init__(self, frequency: float | None = None) -> None:
        # Noise is quicker than what grows, which is the lowest mode and slower.
        self._filter_time = 1.0 / frequency if frequency else FILTER_TIME
        self._longest = SLOWEST * math.pi / frequency if frequency else SWING_TIME
        self._error = np.zeros(3)
        self.forget()

    def forget(self) -> None:
        """Begin to look for oscillations anew."""
        self._swings = tuple(_Swings(self._longest) for _ in range(3))

    def update(self, error: Array, noise: float, elapsed: float) -> bool:
        """
        Return whether the last half-swings do not decay.

        :param error: (3,) of the estimated pose to the reference, turns times the arm [m].
        :param noise: standard deviation of the measured pose [m].
        :param elapsed: since the cycle before [s].
        """
        passed = -math.expm1(-elapsed / self._filter_time)
        self._error = self._error + passed * (error - self._error)
        least = max(SWING, NOISES * noise)
        pairs = zip(self._swings, self._error.tolist(), strict=True)
        return sum(swings.update(value, elapsed, least) for swings, value in pairs) > 0


class _Swings:
    """
    Turning points of one number, and how far apart they are.

    :param longest: time from one to the next in a swing [s].
    """

    def __init__(self, longest: float) -> None:
        self._longest = longest
        self._extreme = self._turned = math.nan
        self._rising, self._age = True, 0.0
        self._sizes: list[float] = []

    def update(self, value: float, elapsed: float, least: float) -> bool:
        """Return whether the last half-swings do not decay; the numbers (m) are of this cycle."""
        if math.isnan(self._extreme):
            self._extreme = self._turned = value
        self._age += elapsed
        sign = 1.0 if self._rising else -1.0
        if sign * (value - self._extreme) >= 0.0:
            self._extreme = value
        elif sign * (self._extreme - value) > least:
            if self._age > self._longest:
                self._sizes.clear()
            self._sizes.append(abs(self._extreme - self._turned))
            self._turned, self._extreme = self._extreme, value
            self._rising, self._age = not self._rising, 0.0
            last = self._sizes[-SWINGS:]
            pairs = zip(last[1:], last, strict=False)
            return len(last) == SWINGS and all(size >= NO_DECAY * old for size, old in pairs)
        return False
