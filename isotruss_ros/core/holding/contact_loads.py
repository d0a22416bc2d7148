# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Loads of the contacts of an object on the tubes."""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.holding.pressed_contacts import ANGLE, Places
from isotruss_ros.core.numerics.arrays import Array, Points
import numpy as np


class Pushes(NamedTuple):
    """Loads of k contacts on the tubes."""

    member_normals: Points  #: (k,) normals in member axes, along + i across
    skin: Array  #: (k,) distance of the dented skin from the centre line [m]
    depth_by_force: Array  #: (k,) derivatives of the dents' depths by the normal forces [m/N]
    depth_by_angle: Array  #: (k,) derivatives of the dents' depths by the normals' angles [m/rad]
    member_forces: Points  #: (k,) forces on the tubes in member axes, along + i across [N]
    loads: Array  #: (k, 3) forces along and across [N] and moments [N m]
    #: (k, 3, 4) derivatives of the loads with respect to inclination, normal and friction force,
    #: and angle of the object
    rates: Array

    def load_rates(self, change: Array) -> Array:
        """Return the changes (k, 3, c) of the loads for c changes of the unknowns."""
        count = len(self.skin)
        angle = np.repeat(change[None, None, ANGLE], count, axis=1)
        causes = np.concatenate([change[Places.of(count).causes].reshape(3, count, -1), angle])
        return self.rates @ causes.swapaxes(0, 1)
