# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Forces on the joints of a robot that holds an object, such as the floor's friction."""

from __future__ import annotations

from dataclasses import dataclass, replace

from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.loaded_frame import displace_nodes, held_joints
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.statics.structure import structure_of
import numpy as np


@dataclass(frozen=True, eq=False)
class JointCompliance:
    """
    How the j joints of a robot give; x and y of joint after joint.

    By Betti, contacts give under forces on joints as joints do under loads on contacts.

    :ivar own: (2j, 2j) displacement by forces on joints where nothing is held [m/N].
    :ivar by_contacts: (2j, 3k) by loads on the contacts, along and across the members and moments
        [m/N], [1/N].
    """

    own: Array
    by_contacts: Array

    def load(self, grip: HeldGrip, forces: Array) -> HeldGrip:
        """
        Return a grip that is not in equilibrium yet: the forces act when it rolls on.

        :param grip: how the object is held.
        :param forces: (2j,) on the joints [N].
        """
        given = (self.by_contacts.T @ forces).reshape(-1, 3)
        return replace(grip, statics=replace(grip.statics, given=given))

    def joints(self, grip: HeldGrip, forces: Array) -> Array:
        """
        Return where the joints are, (2j,) [m].

        :param grip: how the object is held, in equilibrium with the forces.
        :param forces: (2j,) on the joints [N].
        """
        return held_joints(grip).ravel() + self.own @ forces

    def response(self, grip: HeldGrip) -> Array:
        """
        Return the displacements (3 + 2j, 3 + 2j) of object and joints by loads on them [m/N].

        Of the object (fx, fy, m / arm) and (x, y, arm times the angle). Contacts stick.

        :param grip: how the object is held.
        """
        statics, state, places = grip.statics, grip.state, grip.state.places
        count, size = len(grip.anchors), len(self.own)
        right = np.zeros((places.size, 3 + size))
        right[places.balance, :3] = -np.eye(3)
        given = self.by_contacts.T.reshape(count, 3, size)
        right[: 3 * count, 3:] = -given.transpose(1, 0, 2).reshape(3 * count, size)
        change = np.linalg.solve(grip.tangent, right)
        normal, friction = state.normal_forces[:, None], state.friction_forces[:, None]
        local = (statics.compliance.axis.conj() * state.normals)[:, None]
        force = (change[places.normal] + 1j * change[places.friction]) * local
        force += 1j * (normal + 1j * friction) * local * change[places.inclinations]
        depth, soft = statics.indentation(state.normal_forces)
        moment = soft[:, None] * friction * change[places.normal]
        moment -= (statics.tube_radius - depth)[:, None] * change[places.friction]
        loads = np.stack([force.real, force.imag, moment], axis=1).reshape(3 * count, -1)
        moved = self.by_contacts @ loads
        moved[:, 3:] += self.own
        return np.vstack([change[:2], grip.arm * change[2], moved])


def joint_compliance(grip: HeldGrip) -> JointCompliance:
    """
    Return how the joints of a robot give.

    :param grip: how it holds an object.
    :raises StructureError: see `structure_of`.
    """
    frame = structure_of(grip.config, grip.tubes.pressure).frame
    count = len(grip.config.robot.topology.joint_names)
    # A force on a joint is one on the end of a member that is there.
    ends = np.concatenate([frame.members.start, frame.members.end])
    side, member = np.divmod(np.unique(ends, return_index=True)[1][:count], len(frame.length))
    own, turn = np.arange(count), frame.turn[member]
    loads = np.zeros((count, 6, count, 2))
    for axis in range(2):
        loads[own, :, own, axis] = turn[own, :, 3 * side + axis]
    own_moved = frame.displacements(member, loads.reshape(6 * count, 2 * count))
    size = 3 * len(grip.anchors)
    moved = displace_nodes(grip, np.eye(size).reshape(-1, 3, size))
    return JointCompliance(
        own_moved[:count, :2].reshape(2 * count, -1) / grip.tubes.stiffness_scale,
        moved[:count, :2].reshape(2 * count, -1),
    )
