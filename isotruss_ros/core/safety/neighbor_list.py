"""A list of what could come near while the robot moves a little."""

from __future__ import annotations

import math
from typing import NamedTuple

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grasp import Grasp
from isotruss_ros.core.numerics.arrays import Array, Indices
import numpy as np

#: Pairs that are this much farther apart than near are in the list too [m].
SKIN = 0.05


class NeighborList(NamedTuple):
    """
    The pairs that could come near, found where the robot was a while ago (Verlet's list).

    It saves work and changes no result: the distance of two parts changes by no more than
    what both of them have moved.

    :ivar config: where the robot was.
    :ivar grasp: what it held.
    :ivar spare: how far from being near all other pairs were, at least [m].
    :ivar pairs: (k,) numbers of the pairs in the list.
    """

    config: Configuration
    grasp: Grasp | None
    spare: float
    pairs: Indices

    @classmethod
    def find(
        cls, config: Configuration, grasp: Grasp | None, distances: Array, near: float
    ) -> NeighborList:
        """
        Make the list.

        :param config: where the robot is.
        :param grasp: what it holds; None where no distance depends on that.
        :param distances: of all pairs there [m].
        :param near: pairs closer than this are near [m].
        """
        pairs = np.flatnonzero(distances < near + SKIN)
        spare = SKIN if len(pairs) else float(distances.min(initial=np.inf)) - near
        return cls(config, grasp, spare, pairs)

    def is_valid(self, config: Configuration, grasp: Grasp | None) -> bool:
        """
        Tell whether no other pair can be near in another state.

        :param config: where the robot is.
        :param grasp: what it holds, None as in `find`.
        """
        then = self.grasp
        moved = float(np.abs(config.points - self.config.points).max())
        if grasp is None or then is None:
            return grasp is then and 2.0 * moved < self.spare
        if grasp.module != then.module or grasp.diameter != then.diameter:
            return False
        return moved + max(moved, math.dist(grasp.center, then.center)) < self.spare
