# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The two members that hold an object, and the equations of its equilibrium between them."""

from __future__ import annotations

import enum

from isotruss_ros.core.grasping.equilibrium import (
    FEET,
    HeldObjectStatics,
    no_indentation,
    NORMAL,
    SIZE,
)
from isotruss_ros.core.grasping.indentation import Indentation, skin_indentation
from isotruss_ros.core.grasping.member_compliance import MemberCompliance
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.objects import Cylinder
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.statics.pressures import Pressure
from isotruss_ros.core.statics.structure import structure_of
import numpy as np


class Hold(enum.Enum):
    """Whether an object is held; if not, which condition has no solution."""

    HELD = 'held'
    NO_CONTACT = 'fewer than two members press on the object'
    NO_BALANCE = 'no pose near the given one balances the forces'
    FAR = 'the pose that balances the forces is too far from the given one'
    SLIPS = 'the balance needs more friction than there is'
    UNSTABLE = 'the balance is unstable'
    OFF_MEMBER = 'a contact is beyond the end of its member'
    OTHER_CONTACT = 'another member presses on the object'
    WRINKLES = 'a tube wrinkles, outside of the model'

    @property
    def at_rest(self) -> bool:
        """Return whether the linear model holds the object, even if a tube wrinkles."""
        return self in (Hold.HELD, Hold.WRINKLES)


def held_object_statics(
    config: Configuration,
    cylinder: Cylinder,
    members: Indices,
    stiffness_scale: float = 1.0,
    flattening: bool = True,
    pressure: Pressure | None = None,
) -> HeldObjectStatics:
    """
    Return the equations of an object between two members.

    :param config: configuration of the robot.
    :param cylinder: the object.
    :param members: (2,) numbers of the grasping members.
    :param stiffness_scale: stiffness of the robot against that of the model.
    :param flattening: whether the tubes' sections flatten where they are touched.
    :param pressure: gauge [Pa], see `tube_pressures`; that of the robot file if None.
    :raises StructureError: see `structure_of`.
    """
    structure = structure_of(config, pressure)
    compliance = MemberCompliance(structure, members, stiffness_scale)
    aside = (compliance.axis.conj() * (complex(*cylinder.center) - compliance.start)).imag
    radius = 0.5 * cylinder.diameter
    dents = no_indentation
    if flattening:
        tubes = config.robot.topology.tube[members]
        pressures = None if pressure is None else structure.pressures
        tables = [skin_indentation(config.robot, int(tube), radius, pressures) for tube in tubes]
        dents = Indentation(tables, stiffness_scale)
    return HeldObjectStatics(
        compliance,
        radius,
        0.5 * config.robot.description.tube_diameter,
        np.where(aside > 0.0, -1.0, 1.0),
        dents,
    )


def static_start(statics: HeldObjectStatics, center: complex, depths: Array) -> Array:
    """
    Return unknowns (11,) to begin the search for an equilibrium with.

    :param statics: the equations of the held object.
    :param center: of the object, x + iy in the robot frame [m].
    :param depths: (2,) indentation of each member [m].
    """
    compliance = statics.compliance
    feet = (compliance.axis.conj() * (center - compliance.start)).real
    start = np.zeros(SIZE)
    start[:2] = center.real, center.imag
    start[FEET] = np.clip(feet, 0.0, compliance.length)
    own = np.einsum('iaia->ia', compliance.at(start[FEET]).matrix)[:, 1]
    depths = np.maximum(depths, 1e-3 * statics.radius)
    _, dent = statics.indentation(depths / own)
    start[NORMAL] = depths / (own + dent)
    return start
