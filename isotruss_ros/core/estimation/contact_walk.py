# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Test of the corrections of contacts and pose by measured poses in the last seconds."""

from __future__ import annotations

from collections import deque
import math
from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Intervals of the sums of corrections [s].
SUM_INTERVALS = (0.2, 0.6, 1.5, 3.0)
#: An inconsistent jump of this length is a loss [m].
JUMP_LENGTH = 0.02


class _Sum(NamedTuple):
    """Sum of corrections before one, with covariances."""

    time: float  #: [s]
    moved: Array  #: (3,) sum of corrections of the pose before this one [m]
    walked: Array  #: (3, 3) covariance of the walk until then [m^2]
    unsure: Array  #: (3, 3) covariance of contacts and pose then [m^2]
    considered: Array  #: (3, c) derivatives of the pose by what is considered


class ContactWalk:
    """
    Sums of corrections, tested against random walk, noise of poses and load.

    :ivar length: length of the corrections of the last seconds, rotations times the arm [m].
    :ivar deviations: the largest sum in its standard deviations [-].
    """

    def __init__(self) -> None:
        self.length = self.deviations = 0.0
        self._moved, self._walked = np.zeros(3), np.zeros((3, 3))
        self._attached: Array | float = 0.0  # changes of the considered derivatives, see `attach`
        self._sums: deque[_Sum] = deque()

    def spread(self, more: Array) -> None:
        """
        Add process noise.

        :param more: (3, 3) covariance of the walk [m^2].
        """
        self._walked = self._walked + more

    def attach(self, change: Array) -> None:
        """
        Leave out a change of derivatives at a pose that stays, as where the grip is attached anew.

        :param change: (3, c) of the derivatives of the pose by what is considered.
        """
        self._attached = self._attached + change

    def add(
        self,
        time: float,
        moved: Array,
        unsure: Array,
        noise: Array,
        considered: Array,
        spread: Array,
    ) -> None:
        """
        Add a correction.

        :param time: [s].
        :param moved: (3,) by which it moved contacts and pose [m].
        :param unsure: (3, 3) covariance of these before it [m^2].
        :param noise: (3, 3) covariance of pose and load [m^2].
        :param considered: (3, c) derivatives of the pose by what is considered, such as zeros,
            whose error moves the pose as these change.
        :param spread: (c, c) covariance of that.
        """
        considered = considered - self._attached
        self._sums.append(_Sum(time, self._moved, self._walked, unsure, considered))
        self._moved = self._moved + moved
        while time - self._sums[0].time > SUM_INTERVALS[-1]:
            self._sums.popleft()
        self.deviations = self.length = 0.0
        for span in SUM_INTERVALS:
            first = next(each for each in self._sums if time - each.time <= span)
            sum_ = self._moved - first.moved
            changed = considered - first.considered
            allowed = first.unsure + self._walked - first.walked + noise
            allowed = allowed + changed @ spread @ changed.T
            length = math.hypot(*sum_)
            size = math.sqrt(sum_ @ np.linalg.solve(allowed, sum_))
            self.length = max(self.length, length)
            self.deviations = max(self.deviations, size)
