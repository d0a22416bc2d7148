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

from collections import deque
import itertools
import math

from isotruss_ros.core.estimation.grip_belief import MAX_DEVIATIONS
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Ratio of the pose gain to the natural frequency [-]. The loop is stable even if the frequency is
#: wrong by a factor of two.
GAIN_SHARE = 0.25
#: Lowest natural frequency that is assumed if it is unknown [rad/s].
DEFAULT_FREQUENCY = 2.4
#: Largest gain of the squeeze [1/s].
MAX_SQUEEZE_GAIN = 5.0
#: Smallest difference between a maximum and a minimum of the pose, without the part by roller
#: travel, that counts as an oscillation [m]; noise of the measured pose may increase it. With the
#: part by roller travel, the object then swings by some 2 mm.
MIN_SWING = 0.0015
#: The same, relative to the commanded travel since the last extremum [-]. Client-driven motion
#: with the frequency w bends the tubes by (w / omega)^2 of its amplitude, which is less for
#: motions slower than omega / 2.
TRAVEL_SHARE = 0.25
#: Longest half period of an oscillation, in units of pi / omega [-], and in seconds. The gain for
#: omega makes an object swing whose true frequency is below 0.46 omega, because it is heavier than
#: in the model; in MuJoCo, with damping, below 0.23 omega. With a third of the first bound, such
#: swings are not detected; with three times, slow drift of the estimates could count as a swing.
MAX_SWING_PHASE, MAX_SWING_TIME = 5.5, 2.0 * math.pi / DEFAULT_FREQUENCY
#: Smallest number of poses in a half period [-]; with fewer poses, a swing is not resolved.
MIN_SWING_POSES = 3
#: Number of successive half periods after which an oscillation is detected [-], and smallest ratio
#: of their amplitudes [-].
SWING_COUNT, MIN_SWING_RATIO = 3, 0.95


class SwingWatch:
    """
    Detector of oscillations of a held object whose amplitude grows or stays constant.

    :param frequency: lowest natural frequency of the held object; None if unknown [rad/s].
    """

    def __init__(self, frequency: float | None = None) -> None:
        # Noise is faster than a growing oscillation, which is the lowest mode.
        self._filter_time = 1.0 / (frequency or DEFAULT_FREQUENCY)
        self._longest = min(MAX_SWING_PHASE * math.pi * self._filter_time, MAX_SWING_TIME)
        self._pose = np.zeros(3)
        self.forget()

    def forget(self) -> None:
        """Restart the detection of oscillations without past poses."""
        self._swings = tuple(Swings(self._longest) for _ in range(3))

    def update(self, pose: Array, noise: float, elapsed: float, travel: float) -> bool:
        """
        Add an estimated pose; return whether there is an oscillation without decay.

        :param pose: (3,) estimated pose minus the pose by roller travel alone, rotations times the
            characteristic radius [m]. Missing control cycles do not change it.
        :param noise: standard deviation of the measured pose [m].
        :param travel: commanded travel since the previous pose [m].
        """
        # Low-pass filter, in which the new pose has this weight.
        weight = -math.expm1(-elapsed / self._filter_time)
        self._pose = self._pose + weight * (pose - self._pose)
        smallest = max(MIN_SWING, MAX_DEVIATIONS * noise)
        pairs = zip(self._swings, self._pose.tolist(), strict=True)
        growing = [swings.update(value, elapsed, smallest, travel) for swings, value in pairs]
        return any(growing)


class Swings:
    """Detector of oscillation in one signal, with extrema at most `longest` [s] apart."""

    def __init__(self, longest: float) -> None:
        self._longest = longest
        self._extremum = self._previous = math.nan  # last extremum so far, and the one before
        # Sign, 1 while the last extremum is a maximum and -1 while it is a minimum; and time,
        # commanded travel and number of poses since the previous extremum was passed.
        self._sign, self._age, self._travel, self._poses = 1.0, 0.0, 0.0, 0
        self._amplitudes: deque[float] = deque(maxlen=SWING_COUNT)

    def update(self, value: float, elapsed: float, smallest: float, travel: float) -> bool:
        """Add a value; return whether swings larger than `smallest` do not decay."""
        if math.isnan(self._extremum):
            self._extremum = self._previous = value
        self._age += elapsed
        self._travel += travel
        self._poses += 1
        # The extremum follows the value until the value has returned by the smallest swing.
        distance = self._sign * (self._extremum - value)
        if distance <= 0.0:
            self._extremum = value
        if distance <= max(smallest, TRAVEL_SHARE * self._travel):
            return False
        # The extremum ends a half period; after a long or unresolved one, counting restarts.
        if self._age > self._longest or self._poses < MIN_SWING_POSES:
            self._amplitudes.clear()
        self._amplitudes.append(abs(self._extremum - self._previous))
        self._previous, self._extremum = self._extremum, value
        self._sign, self._age, self._travel, self._poses = -self._sign, 0.0, 0.0, 0
        ratios = [b >= MIN_SWING_RATIO * a for a, b in itertools.pairwise(self._amplitudes)]
        return len(self._amplitudes) == SWING_COUNT and all(ratios)
