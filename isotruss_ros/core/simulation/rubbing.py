# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What of a robot and the object that it holds rubs on the floor: where it is, how it gives."""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.joint_loads import joint_compliance, JointCompliance
from isotruss_ros.core.numerics.arrays import Array
import numpy as np


class Rubbing(NamedTuple):
    """
    What rubs on the floor: the object, and joint after joint where these do.

    :ivar places: (n,) x, y and arm times the angle of the object, x and y of each joint [m].
    :ivar compliance: (n, n) displacement by loads (fx, fy, m / arm), and (fx, fy) [m/N].
    :ivar joints: how the joints give; None where they do not rub.
    """

    places: Array
    compliance: Array
    joints: JointCompliance | None

    @classmethod
    def find(cls, grip: HeldGrip, with_joints: bool, loads: Array | None = None) -> Rubbing:
        """
        Return it for a held object.

        :param grip: how it is held, in equilibrium with the loads.
        :param with_joints: whether the joints rub.
        :param loads: (n,) of the floor [N]; none if None.
        :raises StructureError: see `structure_of`.
        """
        even = np.array([1.0, 1.0, grip.arm])
        place = even * np.array(grip.pose)
        if not with_joints:
            return cls(place, even[:, None] * grip.response.pose, None)
        joints = joint_compliance(grip)
        compliance = joints.response(grip)
        forces = np.zeros(len(joints.own)) if loads is None else loads[3:]
        places = np.append(place, joints.joints(grip, forces))
        return cls(places, 0.5 * (compliance + compliance.T), joints)

    def load(self, grip: HeldGrip, loads: Array) -> HeldGrip:
        """
        Return a grip on which the floor's friction on the joints acts when it rolls on.

        :param grip: how the object is held there.
        :param loads: (n,) of the floor [N].
        """
        return grip if self.joints is None else self.joints.load(grip, loads[3:])
