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
    Poses by roller travel alone over time, and low-pass filters of the corrections for control.

    :ivar rolled_poses: poses (3,) by roller travel alone over time [m, m, rad].
    :ivar filters: (2, 4) corrections of pose [m, m, rad] and squeeze [N] that are still in the two
        low-pass filters in series.
    :ivar pose_at_equilibrium: (3,) pose by roller travel alone, at the last equilibrium
        [m, m, rad].
    """

    def __init__(self, pose: Array) -> None:
        self.time, self.pose_at_equilibrium = 0.0, pose
        self._measured = 0.0, pose  # time of the last measured rollers, and pose then
        self.rolled_poses = Timeline().added(*self._measured)
        self.filters = np.zeros((2, 4))

    def record(self, pose: Array, motion: Array, age: float) -> None:
        """Store the present pose (3,), and the pose without the `motion` of the last `age` [s]."""
        # The last call's prediction is replaced, because rollers may follow their commands late.
        poses = self.rolled_poses.added(*self._measured)
        self._measured = self.time - age, pose - motion
        poses = poses.added(*self._measured).added(self.time, pose)
        self.rolled_poses = poses.since(self.time - MAX_TIMEOUT)

    def hold_back(self, correction: Array) -> None:
        """Put a correction (4,) of pose and squeeze into the low-pass filters for control."""
        self.filters[0] += correction

    def advance(self, elapsed: float, filter_time: float) -> None:
        """Advance the low-pass filters by a time; `filter_time` is their time constant [s]."""
        remaining = math.exp(-elapsed / filter_time)
        self.filters[1] += (1.0 - remaining) * self.filters[0]
        self.filters *= remaining
