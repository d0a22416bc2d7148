# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Coulomb friction of the floor under a held object, whatever the rate at which it moves."""

from __future__ import annotations

from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.model.pose import pose_difference
from isotruss_ros.core.numerics.arrays import Array
import numpy as np
import scipy

#: A change of the friction by this share of its limit is none.
NEGLIGIBLE = 1e-7


class FloorFriction:
    """
    The floor holds an object in its place up to a limit, beyond which it slides.

    What slides dissipates as much as it can: the friction is at its limit, against the motion.

    :ivar wrench: (3,) of the floor on the object, (fx, fy, m / arm) [N].
    :param limit: largest size of it, not negative [N].
    """

    def __init__(self, limit: float) -> None:
        self._limit = limit
        self.let_go()

    def let_go(self) -> None:
        """Forget where the object stands: it rubs from its next place on."""
        self.wrench = np.zeros(3)
        self._place: Array | None = None

    def hold_back(self, grasp: HeldGrip) -> bool:
        """
        Change the friction so that the object stays in its place, or as far as the limit allows.

        :param grasp: the object with the present friction.
        :return: whether it changed, so that the equilibrium is to be found anew.
        """
        if self._limit == 0.0 or grasp.response is None:
            return False
        even, pose = np.array([1.0, 1.0, grasp.arm]), np.array(grasp.pose)
        if self._place is None:
            self._place = pose
        away = pose_difference(pose, self._place)
        compliance = even[:, None] * grasp.response.pose
        wanted = self.wrench - np.linalg.solve(compliance, even * away)
        before, self.wrench = self.wrench, limit_wrench(wanted, compliance, self._limit)
        return bool(np.abs(self.wrench - before).max() > NEGLIGIBLE * self._limit)

    def settle(self, grasp: HeldGrip) -> None:
        """
        Take note of where the object stands now, if it has slid.

        :param grasp: the object in equilibrium with the friction.
        """
        if np.linalg.norm(self.wrench) > (1.0 - NEGLIGIBLE) * self._limit:
            self._place = np.array(grasp.pose)


def limit_wrench(wanted: Array, compliance: Array, limit: float) -> Array:
    """
    Return the friction within its limit that is nearest to the wanted one in energy.

    :param wanted: (3,) that would hold the object [N].
    :param compliance: (3, 3) displacement of the object by wrench, positive definite [m/N].
    :param limit: largest size, positive [N].
    """
    size = float(np.linalg.norm(wanted))
    if size <= limit:
        return wanted
    values, axes = np.linalg.eigh(0.5 * (compliance + compliance.T))
    along = axes.T @ wanted

    def left(slid: float) -> Array:
        return values / (values + slid) * along

    # It slides by `slid` times the friction; no further than where it is as soft as anywhere.
    most = values[-1] * (size / limit - 1.0)
    slid = scipy.optimize.brentq(lambda slid: np.linalg.norm(left(slid)) - limit, 0.0, most)
    return axes @ left(slid)
