# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Gains of the squeeze control, and detection of oscillations of the held object.

Commands are roller velocities, so the loop is an integrator in front of a lightly damped
structure. The loop has the pose gain p. The estimated load, and the part of the measured pose that
neither load nor contacts explain (unexplained pose), pass two low-pass filters with the time
constant 1 / p. A mode with the frequency omega and the damping ratio zeta is stable if

    s^3 / p^2 + 3 s^2 / p + 3 s + p omega^2 / (s^2 + 2 zeta omega s + omega^2) = 0

has no root in the right half-plane. Without damping this holds for p < 0.54 omega; with damping it
holds up to a larger p. The gain of the squeeze is p, up to `MAX_SQUEEZE_GAIN`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
import itertools
import math

from isotruss_ros.core.estimation.fault_thresholds import (
    DEFAULT_FREQUENCY,
    MAX_DEVIATIONS,
    MAX_SWING_PHASE,
    MAX_SWING_TIME,
    MIN_RETURN_SHARE,
    MIN_SWING,
    MIN_SWING_POSES,
    MIN_SWING_RATIO,
    SWING_COUNT,
    TRAVEL_SHARE,
)
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.frozen import replace
import numpy as np

#: Ratio of the pose gain to the natural frequency [-]. The loop is stable even if the frequency is
#: wrong by a factor of two.
GAIN_SHARE = 0.25
#: Largest gain of the squeeze [1/s].
MAX_SQUEEZE_GAIN = 5.0


@dataclass(frozen=True)
class Swings:
    """
    Detector of oscillation in one signal.

    :ivar longest: longest half period [s].
    :ivar extremum: last extremum so far; NaN before the first value.
    :ivar previous: extremum before.
    :ivar sign: 1 while the last extremum is a maximum, -1 while it is a minimum.
    :ivar age: time since the previous extremum was passed [s].
    :ivar travel: commanded travel since then [m].
    :ivar poses: number of values since then [-].
    :ivar amplitudes: differences of successive extrema, at most `SWING_COUNT`.
    """

    longest: float
    extremum: float = math.nan
    previous: float = math.nan
    sign: float = 1.0
    age: float = 0.0
    travel: float = 0.0
    poses: int = 0
    amplitudes: tuple[float, ...] = ()

    @property
    def persist(self) -> bool:
        """Return whether successive swings do not decay, and the object swings back."""
        if len(self.amplitudes) < SWING_COUNT or self.age > self.longest:
            return False
        ratios = [b >= MIN_SWING_RATIO * a for a, b in itertools.pairwise(self.amplitudes)]
        swing_back = abs(self.extremum - self.previous)
        return all(ratios) and swing_back >= MIN_RETURN_SHARE * self.amplitudes[-1]

    def updated(self, value: float, elapsed: float, smallest: float, travel: float) -> Swings:
        """Return the detector after a value; smaller swings than `smallest` do not count."""
        extremum = value if math.isnan(self.extremum) else self.extremum
        previous = value if math.isnan(self.extremum) else self.previous
        age, travel, poses = self.age + elapsed, self.travel + travel, self.poses + 1
        # The extremum follows the value until the value has returned by the smallest swing.
        distance = self.sign * (extremum - value)
        if distance <= 0.0:
            extremum = value
        smallest = max(smallest, TRAVEL_SHARE * travel)
        if distance <= smallest:
            signs = self.sign, age, travel, poses, self.amplitudes
            return Swings(self.longest, extremum, previous, *signs)
        # The extremum ends a half period. A small, long or unresolved one is no swing; counting
        # restarts behind it.
        amplitude, amplitudes = abs(extremum - previous), self.amplitudes
        is_swing = amplitude > smallest and age <= self.longest and poses >= MIN_SWING_POSES
        amplitudes = (*amplitudes, amplitude)[-SWING_COUNT:] if is_swing else ()
        return Swings(self.longest, value, extremum, -self.sign, amplitudes=amplitudes)


@dataclass(frozen=True, eq=False)
class SwingWatch:
    """
    Detector of oscillations of a held object whose amplitude grows or stays constant.

    :ivar filter_time: time constant of the low-pass filter [s].
    :ivar swings: detectors of the coordinates.
    :ivar pose: (3,) filtered pose, see `updated` [m].
    """

    filter_time: float
    swings: tuple[Swings, ...]
    pose: Array = field(default_factory=partial(np.zeros, 3))

    @classmethod
    def of(cls, frequency: float | None = None) -> SwingWatch:
        """Return the detector for the lowest natural frequency [rad/s]; None if unknown."""
        # Noise is faster than a growing oscillation, which is the lowest mode.
        filter_time = 1.0 / (frequency or DEFAULT_FREQUENCY)
        longest = min(MAX_SWING_PHASE * math.pi * filter_time, MAX_SWING_TIME)
        return cls(filter_time, (Swings(longest),) * 3)

    def restarted(self) -> SwingWatch:
        """Return the detector without past swings."""
        return replace(self, swings=tuple(Swings(swings.longest) for swings in self.swings))

    def updated(
        self, pose: Array, noise: float, elapsed: float, travel: float
    ) -> tuple[SwingWatch, bool]:
        """
        Return the detector after a pose, and whether there is an oscillation without decay.

        :param pose: (3,) estimated pose minus the pose by roller travel alone, rotations times the
            characteristic radius [m]. Missing control cycles do not change it.
        :param noise: standard deviation of the measured pose [m].
        :param travel: commanded travel since the previous pose [m].
        """
        # Low-pass filter, in which the new pose has this weight.
        weight = -math.expm1(-elapsed / self.filter_time)
        filtered = self.pose + weight * (pose - self.pose)
        smallest = max(MIN_SWING, MAX_DEVIATIONS * noise)
        pairs = zip(self.swings, filtered.tolist(), strict=True)
        swings = tuple(one.updated(value, elapsed, smallest, travel) for one, value in pairs)
        is_reported = any(one.persist for one in swings)
        return SwingWatch(self.filter_time, swings, filtered), is_reported
