# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Delays of the inputs of the belief of a grip.

Poses arrive late, so they are compared with the pose by roller travel at their stamps. Corrections
by poses reach the control behind two low-pass filters, because the loop is stable only then, see
`core.servo.swing_watch`.
"""

from __future__ import annotations

from dataclasses import dataclass
import math

from isotruss_ros.core.inputs import MAX_TIMEOUT, Timeline
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.frozen import replace
import numpy as np


@dataclass(frozen=True, eq=False)
class InputLag:
    """
    Poses by roller travel alone over time, and low-pass filters of the corrections for control.

    :ivar time: time since the start of the belief [s].
    :ivar pose_at_equilibrium: (3,) pose by roller travel alone, at the last equilibrium
        [m, m, rad].
    :ivar measured: time of the last measured rollers [s], and pose by their travel then.
    :ivar rolled_poses: poses (3,) by roller travel alone over time [m, m, rad].
    :ivar filters: (2, 4) corrections of pose [m, m, rad] and squeeze [N] that are still in the two
        low-pass filters in series.
    """

    time: float
    pose_at_equilibrium: Array
    measured: tuple[float, Array]
    rolled_poses: Timeline
    filters: Array

    @classmethod
    def of(cls, pose: Array) -> InputLag:
        """Return the delays at the start of a belief, with its pose (3,)."""
        return cls(0.0, pose, (0.0, pose), Timeline().added(0.0, pose), np.zeros((2, 4)))

    def recorded(self, pose: Array, motion: Array, age: float) -> InputLag:
        """Return the delays with the present pose (3,), and that `age` [s] and `motion` before."""
        # The last call's prediction is replaced, because rollers may follow their commands late.
        measured = self.time - age, pose - motion
        poses = self.rolled_poses.added(*self.measured).added(*measured).added(self.time, pose)
        return replace(self, measured=measured, rolled_poses=poses.since(self.time - MAX_TIMEOUT))

    def held_back(self, correction: Array) -> InputLag:
        """Return the delays with a correction (4,) of pose and squeeze in the filters."""
        return replace(self, filters=np.array([self.filters[0] + correction, self.filters[1]]))

    def advanced(self, elapsed: float, filter_time: float) -> InputLag:
        """Return the delays after a time; `filter_time` is the filters' time constant [s]."""
        remaining = math.exp(-elapsed / filter_time)
        first, second = self.filters
        second = second + (1.0 - remaining) * first
        return replace(self, filters=remaining * np.array([first, second]))
