# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What an object between two members and one in any grip have in common: their contacts stick."""

from __future__ import annotations

import math

from isotruss_ros.core.grasping.balance import ContactForces
from isotruss_ros.core.grasping.contact_statics import ContactStatics
from isotruss_ros.core.grasping.equilibrium import HeldObjectStatics
from isotruss_ros.core.grasping.held_members import Hold
from isotruss_ros.core.grasping.slip_margin import slip_margin, WrenchResponse
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.numerics.arrays import Array, Indices
import numpy as np


class StickingGrasp:
    """
    An object that members hold in one configuration.

    :ivar config: the configuration.
    :ivar members: (m,) numbers of the grasping members.
    :ivar contact_members: (k,) numbers of the members of all contacts.
    :ivar statics: the equations in this configuration.
    :ivar state: their solution.
    :ivar wrench: (fx, fy, m / arm) on the object [N].
    :ivar response: how pose and forces answer to a wrench; None where the equilibrium is
        indifferent.
    """

    config: Configuration
    members: Indices
    contact_members: Indices
    statics: HeldObjectStatics | ContactStatics
    state: ContactForces
    wrench: Array
    response: WrenchResponse | None

    @property
    def pose(self) -> Pose:
        """Return the object's pose; the angle is in (-pi, pi]."""
        x, y, angle = map(float, self.state.unknowns[:3])
        return Pose(x, y, math.remainder(angle, 2.0 * math.pi))

    @property
    def arm(self) -> float:
        """Return the arm by which moments compare with forces: of a disc its radius [m]."""
        return self.statics.arm

    @property
    def member_names(self) -> tuple[str, ...]:
        """Return the names of the grasping members."""
        return tuple(self.config.robot.member_names[i] for i in self.members)

    @property
    def normal_forces(self) -> Array:
        """Return how hard the members press, (m,) [N]."""
        return self._of_members(self.state.normal_forces)

    @property
    def friction_forces(self) -> Array:
        """Return (m,) on the tubes, counter-clockwise around the object [N]."""
        return self._of_members(self.state.friction_forces)

    def _of_members(self, forces: Array) -> Array:
        """Return the sums (m,) of forces (k,) of contacts."""
        owners = self.statics.owners
        alone = len(owners) == owners[-1] + 1
        return forces if alone else np.bincount(owners, weights=forces)

    @property
    def squeeze(self) -> float:
        """Return the mean normal force of the members [N]."""
        forces = self.normal_forces.tolist()
        return sum(forces) / len(forces)

    @property
    def required_friction(self) -> float:
        """Return the smallest coefficient of friction with which all contacts stick."""
        return float((np.abs(self.friction_forces) / self.normal_forces).max())

    def hold(self, friction: float) -> Hold:
        """
        Return whether the contacts stick; if not, what happens.

        :param friction: coefficient between tube and object.
        """
        # One by one: a few numbers of Python are quicker than arrays of them.
        if min(self.normal_forces.tolist()) <= 0.0:
            return Hold.NO_CONTACT
        feet, lengths = self.state.feet.tolist(), self.statics.compliance.length.tolist()
        if not all(0.0 <= foot <= end for foot, end in zip(feet, lengths, strict=True)):
            return Hold.OFF_MEMBER
        return Hold.SLIPS if self.required_friction > friction else Hold.HELD

    def slip_margin(self, friction: float) -> float:
        """
        Return the smallest extra wrench at which a contact slips or lets go, see `slip_margin`.

        :param friction: coefficient between tube and object.
        :return: [N], moments over the arm; zero where the equilibrium is indifferent.
        """
        response = self.response
        return 0.0 if response is None else slip_margin(self.state, response, friction)


def scaled_wrench(wrench: Array | None, arm: float) -> Array:
    """
    Return (fx, fy, m / arm) of (fx, fy, m), zero for None [N].

    :param wrench: (fx, fy, m) about the origin of the object's frame [N, N m]; zero if None.
    :param arm: of the object [m].
    """
    return np.zeros(3) if wrench is None else np.asarray(wrench) / (1.0, 1.0, arm)


def travel_into(config: Configuration, members: Indices) -> Array:
    """
    Return the travel of the tube through the modules at which members start, (k,) [m].

    :param config: configuration of the robot.
    :param members: (k,) numbers of the members.
    """
    topology = config.robot.topology
    travel = np.zeros(topology.n_modules)
    travel[topology.driven] = config.roller_positions
    return travel[members]
