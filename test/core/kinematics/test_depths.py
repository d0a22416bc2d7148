# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""How deep an object is in members, along them and beyond their ends."""

from isotruss_ros.core import ConvexObject, Disc, load_robot
from isotruss_ros.core.kinematics.depths import member_depths
from isotruss_ros.core.model.convex_object import segment_gaps
import numpy as np
import pytest

HOME = load_robot('nine_member').home


@pytest.mark.parametrize('share', [-0.1, 0.05, 0.4, 0.95, 1.1])
def test_a_disc_is_as_deep_in_members_as_they_are_near(share):
    topology = HOME.robot.topology
    starts = HOME.points[topology.b]
    spans = HOME.points[topology.c[topology.following]] - starts
    lattice = starts[:, None] + np.linspace(0.0, 1.0, 10001) * spans[:, None]
    center = starts[1] + (share + 0.07j) * spans[1]
    expected = 0.5 * (0.2 + HOME.robot.description.tube_diameter)
    expected = expected - np.abs(lattice - center).min(axis=1)
    place = (center.real, center.imag)
    for body in (ConvexObject.disc(place, 0.2), ConvexObject(Disc(0.2), (*place, 1.0))):
        assert member_depths(HOME, body) == pytest.approx(expected, abs=1e-6)


def test_the_closed_form_for_discs_is_the_search_for_any_shape():
    topology, rng = HOME.robot.topology, np.random.default_rng(0)
    starts = HOME.points[topology.b]
    ends = HOME.points[topology.c[topology.following]]
    radius = 0.5 * HOME.robot.description.tube_diameter
    for _ in range(200):
        body = ConvexObject.disc(rng.uniform(-1.0, 1.0, 2), rng.uniform(0.05, 0.8))
        expected = radius - segment_gaps(body, starts, ends).gaps
        assert member_depths(HOME, body) == pytest.approx(expected, abs=1e-12)
