# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Utilisation under the forces of a held object, against that of forces at contact points."""

from grips import gripped
from isotruss_ros.core.grasping.contact import ContactState
from isotruss_ros.core.grasping.contact_points import find_contact_points
from isotruss_ros.core.grasping.equilibrium import FEET
from isotruss_ros.core.grasping.held_utilisation import held_utilisation
from isotruss_ros.core.grasping.rolling_grasp import RollingGrasp
from isotruss_ros.core.grasping.surfaces import RoundSurface
from isotruss_ros.core.grasping.wrinkling import find_wrinkling
from isotruss_ros.core.statics.structure import structure_of
import numpy as np
import pytest


@pytest.mark.parametrize('angle', [30.0, 45.0, 60.0])
def test_as_for_the_same_forces_at_the_nearest_contact_points(angle):
    config, cylinder = gripped(angle, squeeze=0.1)
    grasp = RollingGrasp.attach(config, cylinder)
    structure, state = structure_of(config), grasp.state
    radius = 0.5 * (cylinder.diameter + config.robot.description.tube_diameter)
    points = find_contact_points(structure, RoundSurface(state.center, radius), 5e-4)
    feet = grasp.statics.compliance.start + state.unknowns[FEET] * grasp.statics.compliance.axis
    nearest = [int(np.abs(points.points - foot).argmin()) for foot in feet]
    forces = np.zeros(len(points.points))
    normals = np.ones(len(points.points), dtype=complex)
    pushed = (state.normal_forces + 1j * state.friction_forces) * state.normals
    forces[nearest], normals[nearest] = np.abs(pushed), pushed / np.abs(pushed)
    zero = np.zeros(len(forces))
    none = zero.astype(complex)
    contact = ContactState(forces, zero, normals, none, zero, forces * normals)
    pressure = np.array(structure.pressures)[config.robot.topology.tube]
    expected = find_wrinkling(structure, pressure, points, contact).utilisation
    assert held_utilisation(grasp) == pytest.approx(expected, rel=0.01, abs=1e-4)
    assert held_utilisation(grasp).max() > 0.3
