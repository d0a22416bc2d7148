# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Negative slip margin of an object without equilibrium, from the members' gaps to the object.

The slip margin is continued to negative values, so that its gradient leads an optimiser back to
contact. Its absolute value is the norm of the unbalanced external wrench plus p R g, for tubes of
radius R and pressure p at the gap g to the object. A tube that is pressed in by g exerts about the
force p R g.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.depths import member_depths
from isotruss_ros.core.kinematics.distances import collision_model
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.statics.section import Pressure, tube_pressures
import numpy as np


@dataclass(frozen=True, eq=False)
class LostContact:
    """Grasping members that do not hold an object, with the members' gaps to the object."""

    config: Configuration  #: configuration of the robot
    body: ConvexObject  #: the object at its given pose
    members: Indices  #: (k,) indices of the members
    wrench: float  #: norm of the external wrench, with moments over the characteristic radius [N]
    stiffness: float  #: p R, the tubes' mean pressure times their radius [N/m]

    @classmethod
    def of(
        cls,
        config: Configuration,
        body: ConvexObject,
        members: Indices | None,
        wrench: Array,
        pressure: Pressure | None,
    ) -> LostContact:
        """Return the gaps of given members, or of the two members nearest to the object."""
        if members is None:
            members = np.argsort(member_depths(config, body), kind='stable')[-2:]
        file = config.robot.description
        stiffness = 0.5 * file.tube_diameter * np.mean(tube_pressures(file, pressure))
        size = float(np.linalg.norm(wrench))
        return cls(config, body, np.asarray(members), size, float(stiffness))

    @property
    def gap(self) -> float:
        """Return the root mean square of the members' gaps [m]."""
        return float(np.sqrt(np.mean(self._distances[0] ** 2)))

    @property
    def slip_margin(self) -> float:
        """Return the slip margin without equilibrium: -(wrench norm) - p R (gap), negative [N]."""
        return -self.wrench - self.stiffness * self.gap

    def slip_margin_rates(self) -> tuple[Array, Array]:
        """
        Return the derivatives of `slip_margin` with respect to roller travel and object pose.

        :return: (r,) derivatives of the slip margin with respect to roller travel, and (3,) with
            respect to the object's pose.
        """
        distances, by_nodes, by_twist = self._distances
        shares = -self.stiffness * distances
        shares /= max(self.gap * len(distances), np.finfo(float).tiny)
        return shares @ by_nodes @ self.config.node_jacobian, shares @ by_twist

    @cached_property
    def _distances(self) -> tuple[Array, Array, Array]:
        """Return the members' gaps, and their derivatives by nodes and the object's pose."""
        return collision_model(self.config.robot).body_distances(
            self.config, self.body, self.members
        )
