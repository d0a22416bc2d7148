# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Continuation of the slip margin without equilibrium, by the gaps of the members.

The continued slip margin leads an optimiser back to contact. Without contact forces the external
wrench is unbalanced; a tube pressed by a distance g has a force of about p R g.
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
    """
    Grasping members with their gaps to an object.

    :ivar config: configuration of the robot.
    :ivar body: the object at its given pose.
    :ivar members: (k,) indices of the members.
    :ivar wrench: size of the external wrench, moments over the arm [N].
    :ivar stiffness: p R, mean pressure times radius of the tubes [N/m].
    """

    config: Configuration
    body: ConvexObject
    members: Indices
    wrench: float
    stiffness: float

    @classmethod
    def of(
        cls,
        config: Configuration,
        body: ConvexObject,
        members: Indices | None,
        wrench: Array,
        pressure: Pressure | None,
    ) -> LostContact:
        """
        Return the lost contact of members, or of the two nearest ones.

        :param config: configuration of the robot.
        :param body: the object at its given pose.
        :param members: (k,) indices of the members; None: the two nearest.
        :param wrench: (fx, fy, m / arm) on the object [N].
        :param pressure: gauge pressure [Pa], see `tube_pressures`.
        """
        if members is None:
            members = np.argsort(member_depths(config, body), kind='stable')[-2:]
        file = config.robot.description
        stiffness = 0.5 * file.tube_diameter * np.mean(tube_pressures(file, pressure))
        size = float(np.linalg.norm(wrench))
        return cls(config, body, np.asarray(members), size, float(stiffness))

    @property
    def gap(self) -> float:
        """Return the root mean square gap of the members [m]."""
        return float(np.sqrt(np.mean(self._distances[0] ** 2)))

    @property
    def slip_margin(self) -> float:
        """Return minus the external wrench and p R times the gap [N]."""
        return -self.wrench - self.stiffness * self.gap

    def slip_margin_rates(self) -> tuple[Array, Array]:
        """
        Return the derivatives of the slip margin by roller travel, (r,), and pose, (3,).

        :raises ConfigurationError: the configuration is singular.
        """
        distances, by_nodes, by_twist = self._distances
        shares = -self.stiffness * distances
        shares /= max(self.gap * len(distances), np.finfo(float).tiny)
        return shares @ by_nodes @ self.config.node_jacobian, shares @ by_twist

    @cached_property
    def _distances(self) -> tuple[Array, Array, Array]:
        """Return the gaps of the skins, with derivatives by nodes and by the twist."""
        return collision_model(self.config.robot).body_distances(
            self.config, self.body, self.members
        )
