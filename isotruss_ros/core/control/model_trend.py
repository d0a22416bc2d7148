# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What a held object does beyond the rows of (19), between two evaluations of its model."""

from __future__ import annotations

from dataclasses import dataclass
import math

from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Travel from which a trend can be told from rounding [m].
SHORTEST = 1e-6
#: Motions that differ by more, as a share and in speed [m/s], have another trend.
CHANGE, SLOWEST = 0.3, 1e-3


@dataclass(frozen=True, eq=False)
class ModelTrend:
    """
    How pose and squeeze change beyond the rows of (19), for one direction of roller travel.

    Tubes give way as the shape changes, in proportion to the travel where that is short.

    :ivar direction: (r,) unit vector of the travel; zero where nothing is known.
    :ivar pose: (3,) of the object beyond the rows [m/m, rad/m].
    :ivar squeeze: change of the squeeze beyond the slope times the opening [N/m].
    """

    direction: Array
    pose: Array
    squeeze: float

    @classmethod
    def over(cls, travel: Array, pose: Array, squeeze: float) -> ModelTrend:
        """
        Return the trend over some travel.

        :param travel: (r,) of the rollers [m].
        :param pose: (3,) displacement of the object beyond the rows [m, rad].
        :param squeeze: change beyond the slope times the opening [N].
        """
        length = math.sqrt(travel @ travel)
        if length < SHORTEST:
            return cls(np.zeros(len(travel)), np.zeros(3), 0.0)
        return cls(travel / length, pose / length, squeeze / length)

    def along(self, motion: Array) -> float:
        """
        Return the component of a motion in the direction of the trend [m] or [m/s].

        :param motion: (r,) travel [m] or velocities [m/s] of the rollers.
        """
        return float(motion @ self.direction)

    def fits(self, rollers: Array) -> bool:
        """
        Return whether a motion has this direction, either way, or is slow.

        :param rollers: (r,) velocities [m/s].
        """
        across = rollers - self.along(rollers) * self.direction
        return float(np.abs(across).max()) <= CHANGE * float(np.abs(rollers).max()) + SLOWEST
