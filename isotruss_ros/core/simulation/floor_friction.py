# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Coulomb friction of the floor under a held object and the joints, whatever the rate."""

from __future__ import annotations

import math

from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: A change of the friction by this share of its limit is none.
NEGLIGIBLE = 1e-7
#: All that rub change their friction in turn so often at most, and one steps so often.
SWEEPS, STEPS = 200, 30


class FloorFriction:
    """
    The floor holds object and joints in their places up to a limit each, beyond which they slide.

    What slides dissipates as much as it can: the friction is at its limit, against the motion.

    :ivar loads: (n,) of the floor: on the object (fx, fy, m / arm), then (fx, fy) on joint after
        joint where these rub [N].
    :ivar rubs: whether there is any.
    :ivar joints_rub: whether there is under the joints.
    :param limits: largest size of that on the object, and on each joint, not negative [N].
    :param arm: of the object, see `ConvexObject.arm` [m].
    """

    def __init__(self, limits: tuple[float, float], arm: float) -> None:
        self._limits, self._arm = limits, arm
        self.rubs, self.joints_rub = max(limits) > 0.0, limits[1] > 0.0
        self.let_go()

    def let_go(self) -> None:
        """Forget where all stand: they rub from their next places on."""
        self.loads: Array | None = None
        self._places: Array | None = None

    def stand(self, places: Array) -> None:
        """
        Take note of where all stand before they rub.

        :param places: (n,) the object, its turn times the arm, and joint after joint [m].
        """
        if self._places is None:
            self._places, self.loads = places.copy(), np.zeros(len(places))

    def hold_back(self, free: Array, compliance: Array) -> bool:
        """
        Change the friction so that all stay in their places, or as far as the limits allow.

        :param free: (n,) where they would be without friction, see `stand` [m].
        :param compliance: (n, n) by which friction moves them from there [m/N].
        :return: whether it changed.
        """
        most = max(self._limits)
        away, before = free - self._places, self.loads
        away[2] = math.remainder(away[2], 2.0 * math.pi * self._arm)
        self.loads = loads = before.copy()
        away = away + compliance @ loads
        for _ in range(SWEEPS):
            changed = 0.0
            for block, limit in self._blocks():
                own = compliance[block, block]
                wanted = loads[block] - np.linalg.pinv(own, hermitian=True) @ away[block]
                change = limit_load(wanted, own, limit) - loads[block]
                loads[block] += change
                away = away + compliance[:, block] @ change
                changed = max(changed, float(np.abs(change).max()))
            if changed <= NEGLIGIBLE * most:
                break
        return bool(np.abs(loads - before).max() > NEGLIGIBLE * most)

    def settle(self, places: Array) -> None:
        """
        Take note of where what has slid stands now.

        :param places: (n,) see `stand` [m].
        """
        for block, limit in self._blocks():
            if np.linalg.norm(self.loads[block]) > (1.0 - NEGLIGIBLE) * limit:
                self._places[block] = places[block]

    def _blocks(self) -> list[tuple[slice, float]]:
        """Return what rubs as one, and its limit [N]."""
        of_object, of_joint = self._limits
        joints = [(slice(i, i + 2), of_joint) for i in range(3, len(self.loads), 2)]
        return [(slice(3), of_object), *joints]


def limit_load(wanted: Array, compliance: Array, limit: float) -> Array:
    """
    Return the friction within its limit that is nearest to the wanted one in energy.

    It slides by s times the friction; s by Newton's method on one over the size (Moré, Sorensen
    1983).

    :param wanted: (d,) that would hold what rubs [N].
    :param compliance: (d, d) its displacement by loads, positive where it can be moved [m/N].
    :param limit: largest size [N].
    """
    size = float(np.linalg.norm(wanted))
    if size <= limit:
        return wanted
    if limit == 0.0:
        return np.zeros(len(wanted))
    values, axes = np.linalg.eigh(0.5 * (compliance + compliance.T))
    along, slid = axes.T @ wanted, 0.0
    left = along
    for _ in range(STEPS):
        if size <= (1.0 + NEGLIGIBLE**2) * limit:
            break
        slope = float((left**2 / (values + slid)).sum())
        slid += (size / limit - 1.0) * size**2 / slope
        left = values / (values + slid) * along
        size = float(np.linalg.norm(left))
    return axes @ left
