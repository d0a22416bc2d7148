# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Coulomb friction of the floor under a held object and the joints, whatever the rate."""

from __future__ import annotations

import math

from isotruss_ros.core.numerics.arrays import Array, Indices
import numpy as np

#: A change of the friction by this share of its limit is none.
NEGLIGIBLE = 1e-7
#: Most steps of the search for it, the share of its limit that ends it, a force that is none [N].
STEPS, CHANGE, TINY = 1000, 1e-9, 1e-300


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
        away, before = free - self._places, self.loads
        away[2] = math.remainder(away[2], 2.0 * math.pi * self._arm)
        limits = np.array([self._limits[min(i, 1)] for i in range(_blocks(away)[-1] + 1)])
        self.loads = limit_loads(away, compliance, limits, before)
        return bool(np.abs(self.loads - before).max() > NEGLIGIBLE * max(self._limits))

    def settle(self, places: Array) -> None:
        """
        Take note of where what has slid stands now.

        :param places: (n,) see `stand` [m].
        """
        blocks = _blocks(places)
        sizes, limits = np.sqrt(np.bincount(blocks, self.loads**2)), self._limits
        slid = sizes > (1.0 - NEGLIGIBLE) * np.array([limits[0], *[limits[1]] * (len(sizes) - 1)])
        self._places = np.where(slid[blocks], places, self._places)


def limit_loads(away: Array, compliance: Array, limits: Array, start: Array) -> Array:
    """
    Return the friction within its limits that dissipates the most.

    min over f of  f^T C f / 2 + f^T a  by accelerated projected gradients with restarts (Beck,
    Teboulle 2009; O'Donoghue, Candes 2015).

    :param away: (3 + 2j,) a, where object and joints would be without it from where they stand
        [m].
    :param compliance: (3 + 2j, 3 + 2j) C, their displacement by it, positive semi-definite [m/N].
    :param limits: (1 + j,) largest size of that on the object, and on each joint [N].
    :param start: (3 + 2j,) to begin with [N].
    """
    blocks = _blocks(away)
    # In units in which one newton more moves everything alike.
    gives = np.bincount(blocks, np.diag(compliance))
    unit = 1.0 / np.sqrt(np.where(gives > 0.0, gives, 1.0))[blocks]
    scaled, pushed = unit[:, None] * compliance * unit, unit * away
    steepest = float(np.linalg.eigvalsh(scaled)[-1])
    found, wanted, weight = start / unit, start / unit, 1.0
    least = CHANGE * float(limits.max())
    for _ in range(STEPS):
        ahead = wanted - (scaled @ wanted + pushed) / steepest
        sizes = np.sqrt(np.bincount(blocks, (unit * ahead) ** 2))
        ahead *= (limits / np.maximum(sizes, np.maximum(limits, TINY)))[blocks]
        change = ahead - found
        if (wanted - ahead) @ change > 0.0:
            weight = 1.0
        before, weight = weight, 0.5 + math.sqrt(0.25 + weight**2)
        found, wanted = ahead, ahead + (before - 1.0) / weight * change
        if np.abs(unit * change).max() <= least:
            break
    return unit * found


def _blocks(loads: Array) -> Indices:
    """Return to which of object and joints each of (3 + 2j,) numbers belongs."""
    return np.append([0, 0, 0], 1 + np.arange(len(loads) - 3) // 2)
