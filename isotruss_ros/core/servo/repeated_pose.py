# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Detection of a tracker that repeats its last pose with new stamps while the object moves."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
import math

from isotruss_ros.core.inputs import InputError, InputFault, StampedInput
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Largest commanded motion of the object at which its measured pose may stay the same to the last
#: bit, with rotations times the characteristic radius [m]. At rest, poses without noise are equal.
MAX_REPEATED_MOTION = 0.005
#: Largest measured travel of a roller in this time at which rollers may have failed instead [m].
MAX_STUCK_TRAVEL = 0.001


@dataclass(frozen=True, eq=False)
class RepeatedPose:
    """
    Time and commanded motion since the measured pose changed.

    :ivar value: measured pose of the last cycle; empty before the first one.
    :ivar first: stamp of the pose from which the time counts [s].
    :ivar last: stamp of the last equal pose [s].
    :ivar cycle: time of the last cycle [s].
    :ivar motion: (3,) commanded motion of the object since the first equal pose [m, rad].
    :ivar positions: (r,) measured roller positions of the first equal pose [m].
    """

    value: tuple[float, ...] = ()
    first: float = math.nan
    last: float = math.nan
    cycle: float = math.nan
    motion: Array = field(default_factory=partial(np.zeros, 3))
    positions: Array = field(default_factory=partial(np.zeros, 0))

    def updated(
        self,
        pose: StampedInput,
        positions: Array,
        velocity: Array,
        now: float,
        timeout: float,
    ) -> RepeatedPose:
        """
        Return the record with a measured pose, from which the object is at rest.

        The time counts from the first pose after the rollers have moved: at rest, poses without
        noise are equal however long. After a pause without commands, all counts anew.

        :param positions: (r,) measured roller positions [m].
        :param velocity: (3,) velocity of the object since the last cycle [m/s, rad/s].
        """
        elapsed, value = now - self.cycle, tuple(pose.value)
        if value == self.value and 0.0 <= elapsed <= timeout:
            motion = self.motion + elapsed * velocity
            travel = np.abs(positions - self.positions).max(initial=0.0)
            first = pose.time if travel <= MAX_STUCK_TRAVEL else self.first
            return RepeatedPose(value, first, pose.time, now, motion, self.positions)
        return RepeatedPose(value, pose.time, pose.time, now, positions=np.array(positions))

    def check(self, timeout: float, arm: float) -> None:
        """
        Raise InputError if the pose is older than the timeout [s] although its stamp is not.

        :param arm: characteristic radius of the object [m].
        """
        age, distance = self.last - self.first, math.hypot(*(self.motion * (1.0, 1.0, arm)))
        if age > timeout and distance > MAX_REPEATED_MOTION:
            change = f'while the rollers moved the object by {1e3 * distance:.0f} mm'
            message = f'object pose: equal to the last bit for {age:.3f} s {change}'
            remedy = 'the tracker must send new poses, or the object has left the grip'
            raise InputError(InputFault.STALE, 'object_pose', f'{message}: {remedy}')
