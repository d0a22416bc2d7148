# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The external wrench on a held object, estimated from where it is and where the model has it."""

from __future__ import annotations

from dataclasses import dataclass
import math

from isotruss_ros.core.numerics.arrays import Array
import numpy as np


@dataclass(frozen=True)
class LoadSettings:
    """
    What loads and errors are expected.

    The estimate is the most probable wrench for a pose that the tubes give by and that model and
    measurement miss: where the grasp is soft it follows the pose, where it is stiff it is small.

    :ivar size: of the wrench, moments over the object's radius [N].
    :ivar pose_error: of measurement and model together, turns times the radius [m].
    :ivar time: after which a change of the load is in the estimate [s].
    """

    size: float = 5.0
    pose_error: float = 3e-4
    time: float = 0.02


class LoadEstimate:
    """
    The external wrench on an object, and what it does not explain of the measured pose.

    :ivar wrench: (fx, fy, m / radius) [N].
    :ivar bias: (x, y, angle) by which the object is off its model, the wrench included [m, rad].
    :param settings: what is expected.
    """

    def __init__(self, settings: LoadSettings) -> None:
        self.settings = settings
        self.wrench = np.zeros(3)
        self.bias = np.zeros(3)

    def update(
        self, offset: Array, compliance: Array, radius: float, period: float, bias_gain: float
    ) -> Array:
        """
        Take a measurement in.

        :param offset: (3,) measured minus modelled pose, the wrench so far included [m, rad].
        :param compliance: (3, 3) pose by wrench, see `WrenchResponse` [m/N, rad/N].
        :param radius: of the object [m].
        :param period: since the last measurement [s].
        :param bias_gain: share of the bias that is taken over in a second [1/s].
        :return: (3,) by which the wrench changed [N].
        """
        settings, even = self.settings, np.array([1.0, 1.0, radius])
        give = even[:, None] * compliance
        missing = even * offset + give @ self.wrench
        weight = (settings.pose_error / settings.size) ** 2
        probable = np.linalg.solve(give.T @ give + weight * np.eye(3), give.T @ missing)
        change = -math.expm1(-period / settings.time) * (probable - self.wrench)
        self.wrench = self.wrench + change
        left = offset - compliance @ change
        self.bias += -math.expm1(-period * bias_gain) * (left - self.bias)
        return change
