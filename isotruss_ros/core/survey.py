"""What could come near while the robot moves a little: so that not all distances are measured."""

from __future__ import annotations

import math
from typing import NamedTuple

from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.grasp import Grasp
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

#: What is this far from being near is looked at again when things have moved as much [m].
SKIN = 0.05


class Survey(NamedTuple):
    """
    What could come near, found where the robot was a while ago.

    It saves work and changes no answer: the distance between two things changes by no more than
    what both of them have moved.

    :ivar config: where the robot was.
    :ivar grasp: what it held.
    :ivar spare: how far from being near all else was, at least [m].
    :ivar close: (k,) numbers of what was not that far.
    """

    config: Configuration
    grasp: Grasp
    spare: float
    close: Indices

    def holds(self, config: Configuration, grasp: Grasp) -> bool:
        """Tell whether nothing else can be near in another state."""
        then = self.grasp
        if grasp.module != then.module or grasp.diameter != then.diameter:
            return False
        moved = float(np.abs(config.points - self.config.points).max())
        return moved + max(moved, math.dist(grasp.center, then.center)) < self.spare


def survey(config: Configuration, grasp: Grasp, distances: Array, end: float) -> Survey:
    """
    Note what could come near.

    :param distances: of everything [m].
    :param end: what is nearer than this is near [m].
    """
    close = np.flatnonzero(distances < end + SKIN)
    spare = SKIN if len(close) else float(distances.min(initial=np.inf)) - end
    return Survey(config, grasp, spare, close)
