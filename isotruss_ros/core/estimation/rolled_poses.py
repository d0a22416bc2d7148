# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Poses of a held object by roller travel alone, with which late measured poses are compared."""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core.inputs import MAX_TIMEOUT, Timeline
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.frozen import replace


@dataclass(frozen=True, eq=False)
class RolledPoses:
    """
    Poses (x, y, angle) of a held object by roller travel alone [m, m, rad].

    :ivar at_equilibrium: pose (3,) at the last equilibrium.
    :ivar measured: time of the last measured rollers [s], and pose by their travel then.
    :ivar poses: poses (3,) over time.
    """

    at_equilibrium: Array
    measured: tuple[float, Array]
    poses: Timeline

    @classmethod
    def of(cls, pose: Array) -> RolledPoses:
        """Return the poses at the start of a belief, at the time 0."""
        return cls(pose, (0.0, pose), Timeline().added(0.0, pose))

    def recorded(self, time: float, pose: Array, age: float, motion: Array) -> RolledPoses:
        """Return the poses with one at a time [s], and that `age` [s] and `motion` before."""
        # The last call's prediction is replaced, because rollers may follow their commands late.
        measured = time - age, pose - motion
        poses = self.poses.added(*self.measured).added(*measured).added(time, pose)
        return replace(self, measured=measured, poses=poses.since(time - MAX_TIMEOUT))
