"""When the rollers are where on the way to a grasp."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Followers of trajectories want times that increase, however short the way [s].
SHORTEST = 0.01


def path_times(path: Array, max_speed: float) -> Array:
    """
    Return when each waypoint is reached, straight between them as quick as the rollers can.

    :param path: (k, r) roller positions [m].
    :param max_speed: of any roller [m/s].
    :return: (k,) times from the start, the first 0 [s].
    """
    longest = np.abs(np.diff(path, axis=0)).max(axis=1, initial=0.0)
    return np.append(0.0, np.cumsum(np.maximum(longest / max_speed, SHORTEST)))
