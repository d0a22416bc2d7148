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

from isotruss_ros.core.contact.contact_regions import contact_extents, contact_regions
import numpy as np
import pytest


def test_pressure_is_that_of_the_gas_and_of_the_walls_tension_around_the_object():
    points = SimpleNamespace(spacing=0.01, member=np.array([0, 0, 0, 1]), dents=np.eye(4))
    # The last two points are not touched, one of them where the wall would press most.
    contact = SimpleNamespace(
        forces=np.array([2.0, 0.05, 0.0, 0.0]), radii=np.array([0.5, 0.1, 0.01, 0.2])
    )
    tension = np.array([100.0, 300.0, 500.0, 700.0])
    found = contact_regions(points, contact, np.array([1e4, 2e4]), tension)
    # p + T / r
    local = np.array([1e4 + 200.0, 1e4 + 3000.0])
    area = (contact.forces[:2] / local).sum()
    assert found.force == pytest.approx([2.05, 0.0])
    assert found.area == pytest.approx([area, 0.0])
    assert found.pressure == pytest.approx([2.05 / area, 0.0])
    assert found.peak_pressure == pytest.approx([local[1], 0.0])
    assert found.width == pytest.approx([2.0 / local[0] / 0.01, 0.0])


@pytest.mark.parametrize('flattening', [False, True])
def test_points_at_the_ends_of_members_stand_for_half_a_spacing_to_both_sides(flattening):
    # All of one member is touched, of another its first points; out of order.
    order = np.random.default_rng(0).permutation(9)
    member = np.array([0, 0, 0, 1, 1, 1, 1, 1, 2])[order]
    place = 0.01 * np.array([3, 4, 5, 0, 1, 2, 3, 4, 7])[order]
    forces = 0.05 * np.array([1.0, 2.0, 1.0, 2.0, 1.0, 0.0, 0.0, 0.0, 1.0])[order]
    # Where a point is not touched, its gap is three times the depth of the one beside it.
    gaps = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 3e-3, 4e-3, 5e-3, 0.0])[order]
    dents = np.diag(np.full(9, 0.02 if flattening else 0.0))
    points = SimpleNamespace(spacing=0.01, member=member, place=place, dents=dents)
    found = contact_extents(points, SimpleNamespace(forces=forces, gaps=gaps), 4)
    last = 0.25 if flattening else 0.5
    assert found.length == pytest.approx([0.03, 0.01 * (1.5 + last), 0.01, 0.0])
    assert found.spans[:, 0] == pytest.approx([0.025, -0.005, 0.065, np.inf])
    assert found.spans[:, 1] == pytest.approx([0.055, 0.01 * (1.0 + last), 0.075, -np.inf])
