# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Delays of the inputs of the belief of a grip.

Poses arrive late, so they are compared with the pose by roller travel at their stamps. Corrections
by poses reach the control behind two low-pass filters, because the loop is stable only then, see
`core.servo.swing_watch`.
"""

from __future__ import annotations

import math

from isotruss_ros.core.inputs import MAX_TIMEOUT, Timeline
from isotruss_ros.core.numerics.arrays import Array
import numpy as np


class InputLag:
    """
    Poses by roller travel alone, and corrections that the control does not contain yet.

    :ivar way: poses (3,) by roller travel alone over time [m, m, rad].
    :ivar filters: (2, 4) corrections of pose [m, m, rad] and squeeze [N] that are still in the two
        low-pass filters in series.
    :ivar travelled: (3,) pose by roller travel alone at the last equilibrium [m, m, rad].
    """

    def __init__(self, pose: Array) -> None:
        self.time, self.travelled = 0.0, pose
        self._measured = 0.0, pose  # time of the last measured rollers, and pose then
        self.way = Timeline()
        self.way.add(*self._measured)
        self.filters = np.zeros((2, 4))

    def record(self, pose: Array, since: Array, age: float) -> None:
        """Store the pose (3,) now, and the pose `age` [s] ago, smaller by `since` (3,)."""
        # The last call's prediction is replaced, because rollers may follow their commands late.
        self.way.add(*self._measured)
        self._measured = self.time - age, pose - since
        self.way.add(*self._measured)
        self.way.add(self.time, pose)
        self.way.discard_before(self.time - MAX_TIMEOUT)

    def hold_back(self, correction: Array) -> None:
        """Put a correction (4,) of pose and squeeze into the first filter."""
        self.filters[0] += correction

    def advance(self, elapsed: float, filter_time: float) -> None:
        """Advance the two filters with a time constant [s]."""
        remaining = math.exp(-elapsed / filter_time)
        self.filters[1] += (1.0 - remaining) * self.filters[0]
        self.filters *= remaining
