# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
How quickly commands use up what holds an object: the slip margin, and the moments of its tubes.

What a command will use of them is learned from what the travel of the rollers used so far.
"""

from __future__ import annotations

from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.manipulation.status import RollerCommand, Status
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: At this utilisation a tube has folded: more is not told apart.
FOLDED = 2.0
#: Share of the slip margin beyond that which a path uses in a second [1/s].
MARGIN_RATE = 2.0
#: Travel of the rollers in a cycle that tells of the change; shorter ones tell less [m].
TELLING = 1e-4


class UsageLimits:
    """
    Slows commands that would use too much of what is left.

    :param grasp: how the object is held at first.
    """

    def __init__(self, grasp: HeldGrip) -> None:
        rollers = len(grasp.config.roller_positions)
        self._used_ahead, self._margin_ahead = TravelTrend(rollers), TravelTrend(rollers)
        self._take(grasp)

    def learn(self, grasp: HeldGrip, margin: float, travel: Array) -> None:
        """
        Take in what the last travel did.

        :param grasp: how the object is held after it.
        :param margin: change of the slip margin that it made [N].
        :param travel: (r,) of the rollers [m].
        """
        used = self._used
        self._take(grasp)
        self._used_ahead.learn(self._used - used, travel)
        self._margin_ahead.learn(margin, travel)

    def margin_share(self, command: RollerCommand, period: float, free: float) -> float:
        """
        Return the part of a command's twist that leaves enough of the slip margin, 0 to 1.

        :param command: the command.
        :param period: for which it holds [s].
        :param free: slip margin that may be used up [N].
        """
        fall = -self._margin_ahead.ahead(period * command.roller_velocities)
        left = max(period * MARGIN_RATE * free, 0.0)
        return 1.0 if fall <= left else left / fall

    def limit_utilisation(
        self, command: RollerCommand, period: float, most: float, rate: float
    ) -> RollerCommand:
        """
        Return a command, slowed where it would use too much of what is left of the tubes.

        :param command: the command.
        :param period: for which it holds [s].
        :param most: largest utilisation of a tube [-].
        :param rate: share of what is left to that bound that is used in a second [1/s].
        """
        more = self._used_ahead.ahead(period * command.roller_velocities)
        left = max(period * rate * (most - self._used), 0.0)
        if more <= left:
            return command
        return command.slowed(left / more, Status.SLOWED_UTILISATION, (self._member,))

    def _take(self, grasp: HeldGrip) -> None:
        """Take in which member is nearest to its wrinkling moment, and how near."""
        used = grasp.sections.utilisation
        self._member = f'member {grasp.config.robot.member_names[int(used.argmax())]}'
        self._used = min(float(used.max()), FOLDED)


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
