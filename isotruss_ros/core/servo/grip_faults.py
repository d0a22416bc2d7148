# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of the grip under squeeze control, and detection of oscillations."""

from __future__ import annotations

import enum
import math

from isotruss_ros.core.estimation.grip_belief import MAX_DEVIATIONS
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.servo.loop_gains import DEFAULT_GAIN, GAIN_SHARE
import numpy as np

#: Smallest difference of the pose error between a maximum and a minimum that counts as an
#: oscillation [m]; noise of the measured pose may increase it.
MIN_SWING = 0.002
#: Longest half period of an oscillation, in units of pi / omega [-].
MAX_SWING_PHASE = 2.0
#: Lowest natural frequency omega that the default gain assumes [rad/s].
DEFAULT_FREQUENCY = DEFAULT_GAIN / GAIN_SHARE
#: Number of successive half periods after which an oscillation is detected [-], and smallest ratio
#: of their amplitudes [-].
SWING_COUNT, MIN_SWING_RATIO = 3, 0.95


class GripFault(enum.Enum):
    """Faults of the grip, with the status of the halt for each."""

    SLIPPED = Status.HALT_SLIPPED
    NOT_HELD = Status.HALT_NOT_HELD
    OSCILLATES = Status.HALT_OSCILLATES


class SwingWatch:
    """
    Detector of oscillations of a held object whose amplitude grows or stays constant.

    :param frequency: lowest natural frequency of the held object; None if unknown [rad/s].
    """

    def __init__(self, frequency: float | None = None) -> None:
        # Noise is faster than a growing oscillation, which is the lowest mode.
        self._filter_time = 1.0 / (frequency or DEFAULT_FREQUENCY)
        self._longest = MAX_SWING_PHASE * math.pi * self._filter_time
        self._error = np.zeros(3)
        self.forget()

    def forget(self) -> None:
        """Restart the detection of oscillations without past pose errors."""
        self._swings = tuple(_Swings(self._longest) for _ in range(3))

    def update(self, error: Array, noise: float, elapsed: float) -> bool:
        """
        Add the pose error of one cycle; return whether there is an oscillation without decay.

        :param error: (3,) estimated pose error, rotations times the characteristic radius [m].
        :param noise: standard deviation of the measured pose [m].
        :param elapsed: time since the previous cycle [s].
        """
        if elapsed > math.pi * self._filter_time:
            self.forget()  # the cycle is longer than half a period of the lowest mode
        passed = -math.expm1(-elapsed / self._filter_time)
        self._error = self._error + passed * (error - self._error)
        least = max(MIN_SWING, MAX_DEVIATIONS * noise)
        pairs = zip(self._swings, self._error.tolist(), strict=True)
        return sum(swings.update(value, elapsed, least) for swings, value in pairs) > 0


class _Swings:
    """
    Successive maxima and minima of one signal.

    :param longest: longest time between a maximum and the next minimum of an oscillation [s].
    """

    def __init__(self, longest: float) -> None:
        self._longest = longest
        self._extreme = self._turned = math.nan
        self._rising, self._age = True, 0.0
        self._sizes: list[float] = []

    def update(self, value: float, elapsed: float, least: float) -> bool:
        """Add the signal's value in a cycle; return whether its oscillation does not decay."""
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
            last = self._sizes[-SWING_COUNT:]
            pairs = zip(last[1:], last, strict=False)
            return len(last) == SWING_COUNT and all(
                size >= MIN_SWING_RATIO * old for size, old in pairs
            )
        return False
