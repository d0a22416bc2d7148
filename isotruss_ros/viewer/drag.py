"""The twist by which what is dragged follows its handle."""

from __future__ import annotations

import math

#: Speed for a distance [1/s], and the distance that counts as reached [m].
GAIN, REACHED = 2.0, 0.001


def drag_twist(
    position: tuple[float, float], target: tuple[float, float], max_speed: float
) -> tuple[float, float]:
    """
    Return the velocity (vx, vy) toward a target [m/s], zero once it is reached.

    :param position: (x, y) of what is dragged [m].
    :param target: (x, y) of the handle [m].
    :param max_speed: largest speed [m/s].
    """
    dx, dy = target[0] - position[0], target[1] - position[1]
    distance = math.hypot(dx, dy)
    if distance < REACHED:
        return 0.0, 0.0
    speed = min(GAIN * distance, max_speed)
    return speed * dx / distance, speed * dy / distance
