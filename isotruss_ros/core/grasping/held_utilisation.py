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

from isotruss_ros.core.grasping.held_grip import HeldGrip
from isotruss_ros.core.grasping.rolling_grasp import RollingGrasp
from isotruss_ros.core.grasping.wrinkling import load_sections
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.statics.structure import structure_of
import numpy as np


def held_utilisation(grasp: RollingGrasp | HeldGrip) -> Array:
    """
    Return the largest |M| / M_w of each member under the forces of a held object, (m,) [-].

    The turning of the tube by friction at its skin is left out.

    :param grasp: how the object is held.
    :raises StructureError: see `structure_of`.
    """
    structure = structure_of(grasp.config, grasp.pressure)
    frame, topology = structure.frame, grasp.config.robot.topology
    state, compliance = grasp.state, grasp.statics.compliance
    forces = (state.normal_forces + 1j * state.friction_forces) * state.normals
    local = forces * compliance.axis.conj()
    loads = np.stack([local.real, local.imag, np.zeros(len(local))], axis=1)
    carried = compliance.at(state.feet).carried(loads)
    piece, place = compliance.locate(state.feet)
    pressure = np.array(structure.pressures)[topology.tube]
    sections = load_sections(
        structure,
        pressure,
        frame.end_forces(piece, carried),
        piece,
        place,
        forces * frame.axis[piece].conj(),
        grasp.contact_members,
    )
    used = np.zeros(topology.n_modules)
    np.maximum.at(used, sections.member, sections.utilisation)
    return used
