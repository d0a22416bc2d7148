# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The external wrench on a held object, estimated from where it is and where the model has it."""

from __future__ import annotations

from collections.abc import Callable
import math

from isotruss_ros.core.control.loop_gains import LoopGains
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Error of measurement and model of the pose together, turns times the radius [m].
POSE_ERROR = 3e-4


class LoadEstimate:
    """
    The external wrench on an object, and what it does not explain of the measured pose.

    The estimate is the most probable wrench for a pose that the tubes give by and that model and
    measurement miss: where the grasp is soft it follows the pose, where it is stiff it is small.
    Where no load is expected, errors of the model do not become one.

    :ivar offset: (x, y, angle) by which the object is off the model without a load, behind the
        first low-pass [m, rad].
    :ivar wrench: (fx, fy, m / radius) behind the second one [N].
    :ivar bias: (x, y, angle) by which the object is off its model, the wrench included [m, rad].
    :param size: of the wrench that is expected, moments over the object's radius; 0 for none [N].
    """

    def __init__(self, size: float) -> None:
        self._size = size
        self.offset, self.wrench, self.bias = np.zeros(3), np.zeros(3), np.zeros(3)

    def begin(
        self,
        offset: Array,
        compliance: Array,
        radius: float,
        bears: Callable[[Array], bool],
    ) -> Array:
        """
        Begin with the most probable load; with none where the object would slip under it.

        :param offset: (3,) mean of the measured minus the modelled pose [m, rad].
        :param compliance: as for `update`.
        :param radius: of the object [m].
        :param bears: whether the object is held under a wrench (3,) [N].
        :return: (3,) the wrench [N].
        """
        self.offset, probable = offset, self.most_probable(offset, compliance, radius)
        self.wrench = probable if bears(probable) else np.zeros(3)
        self.bias = offset - compliance @ self.wrench
        return self.wrench

    def update(
        self,
        offset: Array,
        compliance: Array,
        radius: float,
        period: float,
        gains: LoopGains,
        bears: Callable[[Array], bool],
    ) -> tuple[Array, bool]:
        """
        Take a measurement in.

        A load under which the object would slip is not believed before it does.

        :param offset: (3,) measured minus modelled pose, the wrench so far included [m, rad].
        :param compliance: (3, 3) pose by wrench, see `WrenchResponse` [m/N, rad/N].
        :param radius: of the object [m].
        :param period: since the last measurement [s].
        :param gains: how quickly.
        :param bears: whether the object is held where the wrench changes by (3,) [N].
        :return: (3,) by which the wrench changed [N], and whether the most probable one is borne.
        """
        passed = -math.expm1(-period / gains.filter_time)
        self.offset = self.offset + passed * (offset + compliance @ self.wrench - self.offset)
        change = passed * (self.most_probable(self.offset, compliance, radius) - self.wrench)
        borne = bears(change)
        if not borne:
            change = -passed * self.wrench
        self.wrench = self.wrench + change
        left = self.offset - compliance @ self.wrench
        self.bias = self.bias - math.expm1(-period * gains.bias) * (left - self.bias)
        return change, borne

    def most_probable(self, offset: Array, compliance: Array, radius: float) -> Array:
        """
        Return the most probable wrench (3,) [N].

        :param offset: (3,) measured pose minus that of the model without a load [m, rad].
        :param compliance: as for `update`.
        :param radius: of the object [m].
        """
        expected, even = self._size**2, np.array([1.0, 1.0, radius])
        give = even[:, None] * compliance
        variance = expected * give @ give.T + POSE_ERROR**2 * np.eye(3)
        return expected * give.T @ np.linalg.solve(variance, even * offset)
