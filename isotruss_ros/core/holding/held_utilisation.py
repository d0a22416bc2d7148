# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""How near the tubes of a robot that holds an object are to wrinkling, friction included."""

from __future__ import annotations

from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.statics.structure import structure_of
from isotruss_ros.core.statics.wrinkling import load_sections, SectionLoads, SectionPoints
import numpy as np


def held_utilisation(grasp: HeldGrip) -> Array:
    """
    Return the largest |M| / M_w of each member under the forces of a held object, (m,) [-].

    :param grasp: how the object is held.
    :raises StructureError: see `structure_of`.
    """
    return held_sections(grasp).largest(grasp.config.robot.topology.n_modules)[0]


def held_sections(grasp: HeldGrip) -> SectionLoads:
    """
    Return what the sections of the tubes bear under the forces of a held object.

    Friction acts at the skin of a tube, so that it turns the tube as well.

    :param grasp: how the object is held.
    :raises StructureError: see `structure_of`.
    """
    structure = structure_of(grasp.config, grasp.tubes.pressure)
    frame, state, statics = structure.frame, grasp.state, grasp.statics
    compliance, feet = statics.compliance, state.feet
    forces = (state.normal_forces + 1j * state.friction_forces) * state.normals
    skin = statics.tube_radius - statics.indentation(state.normal_forces)[0]
    couples = -skin * state.friction_forces
    local = forces * compliance.axis.conj()
    carried = compliance.at(feet).carried(np.column_stack([local.real, local.imag, couples]))
    piece, within = compliance.locate(feet)
    return load_sections(
        structure,
        np.array(structure.pressures)[grasp.config.robot.topology.tube],
        frame.end_forces(piece, carried),
        SectionPoints(piece, within, grasp.contacts.members, feet),
        forces * frame.axis[piece].conj(),
        couples,
    )
