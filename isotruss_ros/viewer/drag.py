# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The twist by which what is dragged follows its handle."""

from __future__ import annotations

import math

#: Distance of the handle that turns the object from its centre [m].
LEVER = 0.35
#: Speed for a distance [1/s], and the distance that counts as reached [m].
GAIN, REACHED = 2.0, 0.001
#: A drag is stuck where it gets less than this share of the way asked for, within so long [s].
PROGRESS, PATIENCE = 0.1, 2.0


class Drag:
    """
    What is dragged on its way to a target.

    :ivar target: (x, y) of the handle [m].
    :ivar turns: whether it turns the object: its places are those of `place_on_circle`, not those
        of the plane.
    :param target: its initial value [m].
    :param now: time [s].
    :param turns: as above.
    """

    def __init__(self, target: tuple[float, float], now: float, turns: bool = False) -> None:
        self.target, self.turns = target, turns
        self._since, self._way = now, 0.0
        self._position, self._velocity = (0.0, 0.0), (0.0, 0.0)

    def follow(
        self, position: tuple[float, float], max_speed: float, now: float
    ) -> tuple[float, float]:
        """
        Return the velocity (vx, vy) toward the target, zero there [m/s], and note the progress.

        :param position: (x, y) of what is dragged [m].
        :param max_speed: largest speed [m/s].
        :param now: time [s].
        """
        # By the direction asked for: the target itself may move faster than what follows it.
        (x, y), (vx, vy) = self._position, self._velocity
        if speed := math.hypot(vx, vy):
            self._way += ((position[0] - x) * vx + (position[1] - y) * vy) / speed
        dx, dy = self.target[0] - position[0], self.target[1] - position[1]
        distance = math.hypot(dx, dy)
        gain = 0.0 if distance < REACHED else min(GAIN, max_speed / distance)
        velocity = gain * dx, gain * dy
        asked = PATIENCE * math.hypot(*velocity)
        if asked == 0.0 or self._way >= PROGRESS * asked:
            self._since, self._way = now, 0.0
        self._position, self._velocity = position, velocity
        return velocity

    def is_stuck(self, now: float) -> bool:
        """
        Return whether there was no progress for PATIENCE.

        :param now: time [s].
        """
        return now - self._since >= PATIENCE


def place_on_circle(angle: float, near: float = 0.0) -> tuple[float, float]:
    """
    Return where an angle is on the way of the handle that turns the object: (way, 0) [m].

    :param angle: of the object [rad].
    :param near: way of which the angle is at most half a turn off [m].
    """
    begin = near / LEVER
    return LEVER * (begin + math.remainder(angle - begin, 2.0 * math.pi)), 0.0
