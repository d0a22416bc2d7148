# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Velocity that moves an object or joint to the position to which its handle was dragged."""

from __future__ import annotations

import math

#: Distance of the rotation handle from the object's centre [m].
LEVER_LENGTH = 0.35
#: Ratio of the speed to the distance from the target [1/s], and distance from the target at which
#: the motion ends [m].
GAIN, ARRIVAL_DISTANCE = 2.0, 0.001
#: Smallest ratio of the executed to the commanded motion [-], and time over which the ratio is
#: averaged [s].
MIN_PROGRESS_RATIO, PROGRESS_TIME = 0.1, 2.0


class Drag:
    """
    Motion of an object or joint to the position to which the user dragged its handle.

    :ivar target: position (x, y) to which the handle was dragged [m].
    :ivar turns: whether the drag rotates the object. Then the target and all positions are arc
        lengths along a circle, see `place_on_circle`.
    :param target: initial target (x, y) [m].
    """

    def __init__(self, target: tuple[float, float], now: float, turns: bool = False) -> None:
        self.target, self.turns = target, turns
        self._since, self._way = now, 0.0
        self._position, self._velocity = (0.0, 0.0), (0.0, 0.0)

    def follow(
        self, position: tuple[float, float], max_speed: float, now: float
    ) -> tuple[float, float]:
        """
        Return the velocity (vx, vy) toward the target [m/s]; it is zero at the target.

        :param position: position (x, y) of the dragged part [m].
        """
        # Along the commanded direction: the target may move faster than the dragged part.
        (x, y), (vx, vy) = self._position, self._velocity
        if speed := math.hypot(vx, vy):
            self._way += ((position[0] - x) * vx + (position[1] - y) * vy) / speed
        dx, dy = self.target[0] - position[0], self.target[1] - position[1]
        distance = math.hypot(dx, dy)
        gain = 0.0 if distance < ARRIVAL_DISTANCE else min(GAIN, max_speed / distance)
        velocity = gain * dx, gain * dy
        asked = PROGRESS_TIME * math.hypot(*velocity)
        if asked == 0.0 or self._way >= MIN_PROGRESS_RATIO * asked:
            self._since, self._way = now, 0.0
        self._position, self._velocity = position, velocity
        return velocity

    def is_stuck(self, now: float) -> bool:
        """Return whether the part has not approached the target for `PROGRESS_TIME` seconds."""
        return abs(now - self._since) >= PROGRESS_TIME


def place_on_circle(angle: float, near: float = 0.0) -> tuple[float, float]:
    """
    Return the position (s, 0) of the rotation handle, with the arc length s on its circle [m].

    :param angle: angle of the object [rad].
    :param near: arc length from which s differs by at most half a turn [m].
    """
    begin = near / LEVER_LENGTH
    return LEVER_LENGTH * (begin + math.remainder(angle - begin, 2.0 * math.pi)), 0.0
