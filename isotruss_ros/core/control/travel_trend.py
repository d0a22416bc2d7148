# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""How a quantity changes with the travel of the rollers, learned from cycle to cycle."""

from __future__ import annotations

from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Travel of the rollers in a cycle that tells of the change; shorter ones tell less [m].
TELLING = 1e-4


class TravelTrend:
    """
    The derivative of a quantity by travel (least mean squares).

    :param rollers: number r of rollers.
    """

    def __init__(self, rollers: int) -> None:
        self._by_travel = np.zeros(rollers)

    def learn(self, change: float, travel: Array) -> None:
        """
        Take a change in.

        :param change: of the quantity over some travel.
        :param travel: (r,) of the rollers [m].
        """
        missed = change - float(self._by_travel @ travel)
        self._by_travel = self._by_travel + missed / float(travel @ travel + TELLING**2) * travel

    def ahead(self, travel: Array) -> float:
        """
        Return by how much the quantity is expected to change.

        :param travel: (r,) of the rollers [m].
        """
        return float(self._by_travel @ travel)
