# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Time along a path: it slows down where the robot cannot follow, and never jumps."""

from __future__ import annotations

import math

from isotruss_ros.core.inputs import Timeline

#: Measurements are no older than this [s].
MEMORY = 1.0
#: Limits of the robot do not slow below this rate: the rest of the path may lead away from them.
MIN_RATE = 0.1
#: A robot that follows at less than this rate makes no progress.
STANDSTILL = 0.05


class PathClock:
    """
    Runs from 0 to the path's duration at a rate from 0 to 1.

    :ivar time: path time [s].
    :ivar rate: path time by time.
    :ivar ramp_time: from rest to rate 1 and back [s].
    :ivar waited: time since the last progress [s].
    :ivar period: of the control loop, which may change on the path [s].
    :param duration: of the path [s].
    :param ramp_time: from rest to rate 1 and back [s].
    :param progress_timeout: how long a time counts for progress [s].
    :param period: of the control loop; a longer cycle than two counts as two [s].
    """

    def __init__(
        self, duration: float, ramp_time: float, progress_timeout: float, period: float
    ) -> None:
        self.time = self.rate = self.waited = 0.0
        self._duration, self.ramp_time = duration, ramp_time
        self._least_progress = STANDSTILL * progress_timeout
        self._mark = self._now = 0.0
        self.period = period
        self._known = Timeline()
        self._known.add(0.0, 0.0)

    @property
    def at_end(self) -> bool:
        """Tell whether the path is over."""
        return self.time >= self._duration

    @property
    def time_left(self) -> float:
        """Return how long the rest takes if nothing slows: up the ramp, on, down the ramp [s]."""
        left = self._duration - self.time
        peak = min(1.0, math.sqrt(left / self.ramp_time + 0.5 * self.rate**2))
        cruise = left - (peak**2 - 0.5 * self.rate**2) * self.ramp_time
        return (2.0 * peak - self.rate) * self.ramp_time + max(cruise, 0.0)

    def time_then(self, elapsed: float, age: float) -> float:
        """
        Return what path time was some time ago [s].

        :param elapsed: since the last call of `advance` [s].
        :param age: how long ago [s].
        """
        return self._known.at(self._now + elapsed - age)

    def step(self, elapsed: float) -> float:
        """
        Return what part of the elapsed time counts: a starved loop does not leap ahead [s].

        :param elapsed: time since the last cycle [s].
        """
        return min(max(elapsed, 0.0), 2.0 * self.period)

    def advance(self, elapsed: float, room: float, scale: float, held: bool) -> None:
        """
        Move path time to where it is to be one cycle from now.

        :param elapsed: since the last call [s].
        :param room: 0 to 1, the rate that the lag of the robot allows; obeyed at once.
        :param scale: 0 to 1, what part of the last twist the limits of the robot left; followed at
            the pace of the ramp, since the status of a slower twist is received some cycles later.
        :param held: whether the robot is stopped.
        """
        self._now += max(elapsed, 0.0)
        if self._now > self._known.last[0]:
            self._known.add(self._now, self.time)
        self._known.discard_before(self._now - MEMORY)
        step = self.step(elapsed)
        wanted = 1.0 if scale >= 1.0 else max(self.rate * scale, MIN_RATE)
        most = step / self.ramp_time
        rate = min(max(wanted, self.rate - most), self.rate + most)
        left = self._duration - self.time
        self.rate = 0.0 if held else min(rate, room, math.sqrt(2.0 * left / self.ramp_time))
        self.time = min(self.time + self.rate * step, self._duration)
        self._known.add(self._now + self.period, self.time)
        self.waited += max(elapsed, 0.0)
        if self.time - self._mark > self._least_progress:
            self.waited, self._mark = 0.0, self.time
