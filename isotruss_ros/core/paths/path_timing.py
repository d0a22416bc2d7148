# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Path time, which advances more slowly if the robot lags behind, and never jumps."""

from __future__ import annotations

import math

from isotruss_ros.core.inputs import MAX_TIMEOUT, Timeline

#: Smallest rate of path time while limits slow the robot [-]; at this rate the path goes on to
#: poses at which no limit binds.
MIN_LIMITED_RATE = 0.1


class PathClock:
    """
    Clock of the path time, which runs from 0 to the path's duration at a rate from 0 to 1.

    :ivar ramp_time: time in which the rate changes from 0 to 1, or back [s].
    :ivar waited: time since the last progress [s].
    """

    def __init__(
        self, duration: float, ramp_time: float, progress_timeout: float, period: float
    ) -> None:
        self.time = self.rate = self.waited = 0.0
        self._duration, self.ramp_time = duration, ramp_time
        # Progress at half of the smallest rate under limits counts as none.
        self._least_progress = 0.5 * MIN_LIMITED_RATE * progress_timeout
        self._mark = self._now = 0.0
        self.period = period
        self._known = Timeline()
        self._known.add(0.0, 0.0)

    @property
    def at_end(self) -> bool:
        """Return whether path time has reached the end of the path."""
        return self.time >= self._duration

    @property
    def time_left(self) -> float:
        """Return the time to the end of the path at full rate of path time [s]."""
        remaining = self._duration - self.time
        peak = min(1.0, math.sqrt(remaining / self.ramp_time + 0.5 * self.rate**2))
        cruise = remaining - (peak**2 - 0.5 * self.rate**2) * self.ramp_time
        return (2.0 * peak - self.rate) * self.ramp_time + max(cruise, 0.0)

    def time_then(self, elapsed: float, age: float) -> float:
        """Return the path time `elapsed` - `age` after the last call of `advance` [s]."""
        return self._known.at(self._now + elapsed - age)

    def step(self, elapsed: float) -> float:
        """Return an elapsed time of at most two periods, so that a late cycle causes no jump."""
        return min(max(elapsed, 0.0), 2.0 * self.period)

    def advance(self, elapsed: float, room: float, scale: float, held: bool) -> None:
        """
        Advance path time by one cycle of the control loop.

        A rate above `room`, the largest that the robot's lag admits, is reduced at once. The rate
        approaches `scale` along a ramp, because this feedback on limits is some cycles late.
        """
        self._now += max(elapsed, 0.0)
        if self._now > self._known.last[0]:
            self._known.add(self._now, self.time)
        self._known.discard_before(self._now - MAX_TIMEOUT)
        step = self.step(elapsed)
        wanted = 1.0 if scale >= 1.0 else max(self.rate * scale, MIN_LIMITED_RATE)
        most = step / self.ramp_time
        rate = min(max(wanted, self.rate - most), self.rate + most)
        remaining = self._duration - self.time
        self.rate = 0.0 if held else min(rate, room, math.sqrt(2.0 * remaining / self.ramp_time))
        self.time = min(self.time + self.rate * step, self._duration)
        self._known.add(self._now + self.period, self.time)
        self.waited += max(elapsed, 0.0)
        if self.time - self._mark > self._least_progress:
            self.waited, self._mark = 0.0, self.time
