# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Detection of a tracker that repeats its last pose with new stamps while the object moves."""

from __future__ import annotations

import math

from isotruss_ros.core.inputs import InputError, InputFault, StampedInput
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Largest commanded motion of the object at which its measured pose may stay the same to the last
#: bit, with rotations times the characteristic radius [m]. At rest, poses without noise are equal.
MAX_REPEATED_MOTION = 0.005
#: Largest measured travel of a roller in this time at which rollers may have failed instead [m].
MAX_STUCK_TRAVEL = 0.001


class RepeatedPose:
    """
    Time and commanded motion since the measured pose changed.

    :ivar velocity: (3,) velocity of the object by the last command [m/s, rad/s].
    """

    def __init__(self) -> None:
        self._value: tuple[float, ...] = ()
        self._first = self._now = math.nan  # stamp where the time begins, and last cycle [s]
        self._motion = self.velocity = np.zeros(3)
        self._positions = np.zeros(0)  # (r,) measured with the first equal pose [m]

    def check(
        self, pose: StampedInput, positions: Array, now: float, timeout: float, arm: float
    ) -> None:
        """
        Raise InputError if the pose is older than the timeout [s] although its stamp is not.

        The time counts from the first pose after the rollers have moved: at rest, poses without
        noise are equal however long. After a pause without commands, all counts anew.

        :param positions: (r,) measured roller positions [m].
        :param arm: characteristic radius of the object [m].
        """
        elapsed, value = now - self._now, tuple(pose.value)
        if value == self._value and 0.0 <= elapsed <= timeout:
            self._motion = self._motion + elapsed * self.velocity
        else:
            self._value, self._first, self._motion = value, pose.time, np.zeros(3)
            self._positions = np.array(positions)
        self._now, self.velocity = now, np.zeros(3)
        if np.abs(positions - self._positions).max(initial=0.0) <= MAX_STUCK_TRAVEL:
            self._first = pose.time
        age, distance = pose.time - self._first, math.hypot(*(self._motion * (1.0, 1.0, arm)))
        if age > timeout and distance > MAX_REPEATED_MOTION:
            change = f'while the rollers moved the object by {1e3 * distance:.0f} mm'
            message = f'object pose: equal to the last bit for {age:.3f} s {change}'
            remedy = 'the tracker repeats its last pose; it must send new ones'
            raise InputError(InputFault.STALE, 'object_pose', f'{message}: {remedy}')
