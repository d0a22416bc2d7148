# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Grips between two members whose places are written down: where they touch, and where not."""

from isotruss_ros.core import (
    Configuration,
    ConvexObject,
    Disc,
    Grip,
    load_robot,
    place_between,
    Polygon,
    Pose,
)
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.manipulation.grip import find_members
from isotruss_ros.core.manipulation.grip_contacts import find_contacts
import numpy as np
import pytest

ROBOT = load_robot('nine_member')
NAMES = ('south/P-Q', 'north/R-P')
TUBE = ROBOT.description.tube_diameter
BOX = Polygon([(0.0, 0.0), (0.2, 0.0), (0.2, 0.1), (0.0, 0.1)])


def between(*members):
    """Return a configuration with two members in given places, whatever that does to others."""
    nodes, points = find_members(ROBOT, NAMES), ROBOT.home.points.copy()
    for number, (start, end) in enumerate(members):
        points[nodes.starts[number]], points[nodes.ends[number]] = start, end
    return Configuration(ROBOT, ROBOT.home.roller_positions.copy(), points)


def test_a_face_may_reach_beyond_the_end_of_a_member_and_not_lie_there():
    config = between((0.0, 1.0), ((0.1 + TUBE) * 1j, 2.0 + (0.1 + TUBE) * 1j))
    for x in (0.5, 0.85, 0.95, 0.99):
        body = ConvexObject(BOX, Pose(x, 0.5 * TUBE, 0.0))
        contacts = find_contacts(config, Grip(NAMES, body))
        assert contacts.points.real == pytest.approx([x, x + 0.2, x + 0.2, x], abs=1e-12)
        assert contacts.points.imag == pytest.approx(
            0.5 * TUBE + np.array([0.0, 0.0, 0.1, 0.1]), abs=1e-12
        )
    for x, share in ((1.05, '1.05'), (-0.25, '-0.05')):
        body = ConvexObject(BOX, Pose(x, 0.5 * TUBE, 0.0))
        with pytest.raises(GraspError, match=f'{NAMES[0]} .* it would touch at {share} of its'):
            find_contacts(config, Grip(NAMES, body))


@pytest.mark.parametrize('aside', [0.2 + 0.2j, 0.2 - 0.2j, -0.2 + 0.2j, -0.2 - 0.2j])
def test_of_four_places_between_crossing_members_it_is_the_one_nearest_to_their_middle(aside):
    center = 0.3 - 0.2j
    config = between(
        (center + aside.real - 1.0, center + aside.real + 1.0),
        (center + 1j * (aside.imag - 1.0), center + 1j * (aside.imag + 1.0)),
    )
    grip = place_between(config, NAMES, Disc(0.3))
    away = 0.15 + 0.5 * TUBE
    wanted = center + complex(np.sign(aside.real), np.sign(aside.imag)) * away
    assert grip.center == pytest.approx(wanted, abs=1e-9)
