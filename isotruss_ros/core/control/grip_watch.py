# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What tells that the grip of a regulated object is not as the model has it.

All lengths count turns of the object times its arm.
"""

from __future__ import annotations

from collections import deque
import enum
import math

from isotruss_ros.core.control.held_model import Observation
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: An object that is off its model by more than this [m] for as long as this [s] has slipped.
SLIP, SLIP_TIME = 0.005, 2.0
#: A pose lies that departs from the model by so much more than the expected load explains [m] ...
LIE = 0.006
#: ... on a way of so many steps at most [m] ...
STEP, STEPS = 0.0005, 150
#: ... and goes as twists ask for, as closely as this [m].
LED = 0.002
#: A pose lies that does not move by this [m] where members and twists move the object by that [m].
STUCK, MOVED = 0.0002, 0.004
#: Half-swings of the pose error from this size on count [m], and from this many times the noise
#: where that is more ...
SWING, NOISES = 0.002, 2.5
#: ... where they take less than so many times pi / omega, or this time if that is not known [s].
SLOWEST, SWING_TIME = 2.0, 0.5
#: So many half-swings, each at least so large against the one before it, do not decay.
SWINGS, NO_DECAY = 3, 0.95
#: Low-pass on what is measured; for swings, 1 / omega where that is known [s].
FILTER_TIME = 0.05


class GripFault(enum.Enum):
    """What is wrong with the grip."""

    SLIPPED = 'slipped'
    NOT_HELD = 'not held'
    POSE_DISAGREES = 'the pose disagrees'
    OSCILLATES = 'oscillates'

    @property
    def halt(self) -> Status:
        """Return the status in this fault."""
        return Status[f'HALT_{self.name}']


class GripWatch:
    """
    Compares the measured pose of a held object with the model, and looks for oscillations.

    - An object that slipped stays off the model; a short load does not.
    - A pose that lies stands still, or goes as twists ask for, and the members do not. A load
      moves the object off both.
    - An oscillation that grows, or does not decay, has half-swings that do not.

    :param frequency: lowest natural frequency of the held object; None if not known [rad/s].
    """

    def __init__(self, frequency: float | None = None) -> None:
        self._frequency = frequency
        self._apart, self._unexplained, self._aside, self._error = np.zeros((4, 3))
        self._slipped_for = 0.0
        self._asked, self._measured, self._travelled = np.zeros(3), np.zeros(3), 0.0
        # Where the measured pose went, and how far off the model and off where twists led.
        self._places: deque[Array] = deque(maxlen=STEPS)
        # Noise is quicker than what grows, which is the lowest mode and slower.
        self._swing_filter = 1.0 / frequency if frequency else FILTER_TIME
        self.forget_swings()

    def forget_swings(self) -> None:
        """Begin to look for oscillations anew."""
        longest = SLOWEST * math.pi / self._frequency if self._frequency else SWING_TIME
        self._swings = tuple(_Swings(longest) for _ in range(3))

    def update(
        self, seen: Observation, error: Array, asked: Array, moved: Array, elapsed: float
    ) -> GripFault | None:
        """
        Take one cycle in.

        :param seen: the measured pose against its model.
        :param error: (3,) what is missing to the reference [m].
        :param asked: (3,) motion that the twist of the last cycle asked for [m].
        :param moved: (3,) motion of the measured pose since the last cycle [m].
        :param elapsed: since the cycle before [s].
        """
        passed = -math.expm1(-elapsed / FILTER_TIME)
        self._apart = self._apart + passed * (seen.apart - self._apart)
        self._unexplained = self._unexplained + passed * (seen.unexplained - self._unexplained)
        followed = -math.expm1(-elapsed / self._swing_filter)
        self._error = self._error + followed * (error - self._error)
        self._asked, self._measured = self._asked + asked, self._measured + moved
        self._aside = self._aside + passed * (self._measured - self._asked - self._aside)
        away = math.hypot(*self._unexplained)
        self._slipped_for = self._slipped_for + elapsed if away > SLIP else 0.0
        explained = math.hypot(*(seen.apart - seen.unexplained))
        if self._departs(asked, explained):
            return GripFault.POSE_DISAGREES
        if self._slipped_for > (SLIP_TIME if seen.borne else 0.0):
            return GripFault.SLIPPED
        grown = [
            swings.update(value, elapsed, max(SWING, NOISES * seen.noise))
            for swings, value in zip(self._swings, self._error.tolist(), strict=True)
        ]
        return GripFault.OSCILLATES if any(grown) else None

    def _departs(self, asked: Array, explained: float) -> bool:
        """Return whether the pose departs from the model, and stands still or goes as asked."""
        here = np.array((self._measured, self._apart, self._aside))
        if self._travelled == 0.0 and asked.any():
            self._places.append(here)
        self._travelled += math.hypot(*asked)
        if self._travelled < STEP:
            return False
        self._travelled = 0.0
        since = np.linalg.norm(here - np.array(self._places)[::-1], axis=2)
        stayed, apart, aside = since.T
        stuck = np.logical_and.accumulate(stayed < STUCK)
        led = np.logical_and.accumulate(aside < LED)
        way = STEP * np.arange(1, len(since) + 1)
        stands = stuck & (np.minimum(way, apart) > MOVED)
        return bool((stands | led & (apart > LIE + explained)).any())


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
