# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Where the nodes of a robot that holds an object are: its tubes give under the contacts."""

from __future__ import annotations

from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.numerics.arrays import Array, as_xy
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.statics.structure import structure_of
import numpy as np


@single_threaded
def held_joints(grip: HeldGrip) -> Array:
    """
    Return the joints (j, 2) of a robot that holds an object, in `Topology.joint_names` order [m].

    They are off those of `Configuration.nodes` by what the contact forces do to the frame.

    :param grip: how the object is held.
    :raises StructureError: see `structure_of`.
    """
    moved = displace_nodes(grip, grip.state.normal_forces, grip.state.friction_forces)
    count = len(grip.config.robot.topology.joint_names)
    return grip.config.nodes[:count] + moved[:count, :2, 0]


def displace_nodes(grip: HeldGrip, normal: Array, friction: Array) -> Array:
    """
    Return the displacements (n, 3, c) of the frame's nodes under contact forces [m, rad].

    :param grip: where the contacts are.
    :param normal: (k,) or (k, c) normal forces of the contacts in each of c cases [N].
    :param friction: (k,) or (k, c) friction forces [N].
    :raises StructureError: see `structure_of`.
    """
    structure = structure_of(grip.config, grip.tubes.pressure)
    state, statics = grip.state, grip.statics
    compliance, feet = statics.compliance, state.feet
    local = compliance.axis.conj() * state.normals
    # A case a row, so that the contacts are the last axis of all.
    normal, friction = np.atleast_2d(normal.T), np.atleast_2d(friction.T)
    forces = (normal + 1j * friction) * local
    # Friction acts at the skin of a tube, so that it turns the tube as well.
    couples = -(statics.tube_radius - statics.indentation(state.normal_forces)[0]) * friction
    at_feet = compliance.at(feet)
    loads = [
        at_feet.carried(np.column_stack([as_xy(force), couple])).ravel()
        for force, couple in zip(forces, couples, strict=True)
    ]
    moved = structure.frame.displacements(compliance.locate(feet)[0], np.column_stack(loads))
    return moved / grip.tubes.stiffness_scale
