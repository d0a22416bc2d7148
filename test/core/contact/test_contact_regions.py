# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Regions of contact: pressures and widths of a few points, and how far contact goes."""

from types import SimpleNamespace

from isotruss_ros.core import analyze_grasp, ConvexObject, load_robot, tangent_center
from isotruss_ros.core.contact.contact_regions import find_wrinkling
from isotruss_ros.core.contact.refinement import measure_contact
import numpy as np
import pytest


def test_pressure_is_that_of_the_gas_and_of_the_walls_tension_around_the_object():
    robot = load_robot('nine_member')
    gauge = {'south': 30e3, 'east': 25e3, 'north': 20e3}
    center = tangent_center(robot.home, 'south/P', 0.3, 0.01)
    analysis = analyze_grasp(robot.home, ConvexObject.disc(center, 0.3), pressure=gauge)
    points, contact, *_ = analysis.solution.solved
    _, tension = find_wrinkling(analysis.solution.structure, points, contact)
    assert len(analysis.contact_forces) == 2
    for name, force in analysis.contact_forces.items():
        on = (points.member == robot.member_names.index(name)) & (contact.forces > 0.0)
        local = gauge['south'] + tension[on] / 0.15  # p + T / r
        area = (contact.forces[on] / local).sum()
        assert force == pytest.approx(contact.forces[on].sum())
        assert analysis.contact_areas[name] == pytest.approx(area)
        assert analysis.contact_pressures[name] == pytest.approx(force / area)
        assert analysis.peak_pressures[name] == pytest.approx(local.max())
        width = (contact.forces[on] / local).max() / points.spacing
        assert analysis.contact_widths[name] == pytest.approx(width)


@pytest.mark.parametrize('flattening', [False, True])
def test_points_at_the_ends_of_members_stand_for_half_a_spacing_to_both_sides(flattening):
    # All of one member is touched, of another its first points.
    member = np.array([0, 0, 0, 1, 1, 1, 1, 1, 2])
    place = 0.01 * np.array([3, 4, 5, 0, 1, 2, 3, 4, 7])
    forces = 0.05 * np.array([1.0, 2.0, 1.0, 2.0, 1.0, 0.0, 0.0, 0.0, 1.0])
    # Where a point is not touched, its gap is three times the depth of the one beside it.
    gaps = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 3e-3, 4e-3, 5e-3, 0.0])
    dents = np.diag(np.full(9, 0.02 if flattening else 0.0))
    points = SimpleNamespace(spacing=0.01, member=member, place=place, dents=dents)
    found = measure_contact(points, SimpleNamespace(forces=forces, gaps=gaps), 4)
    last = 0.25 if flattening else 0.5
    assert found.length == pytest.approx([0.03, 0.01 * (1.5 + last), 0.01, 0.0])
    assert found.spans[:, 0] == pytest.approx([0.025, -0.005, 0.065, np.inf])
    assert found.spans[:, 1] == pytest.approx([0.055, 0.01 * (1.0 + last), 0.075, -np.inf])
