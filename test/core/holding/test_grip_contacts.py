# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Which contacts of a grip press or pull, and which of them are tried."""

from types import SimpleNamespace

from held_grips import BOX, held, HOME
from isotruss_ros.core import Ellipse
from isotruss_ros.core.holding.attach_grip import _choices, attach_grip
from isotruss_ros.core.holding.contact_forces import PressedContacts
from isotruss_ros.core.holding.held_grip import HeldGrip
import numpy as np
import pytest


@pytest.mark.parametrize(
    ('owners', 'forces', 'presses', 'pulling'),
    [
        ([0, 0, 1], [0.05, 2.0, 3.0], True, None),
        ([0, 0, 1], [-0.05, 2.0, 3.0], False, 0),
        ([0, 0, 1], [0.0, 2.0, 3.0], False, None),
        # Of two members the only contacts, of three all.
        ([0, 1], [-1.0, 2.0], True, None),
        ([0, 0, 1], [1.0, 1.0, -1.0], True, None),
        ([0, 1, 2], [1.0, -1.0, -0.5], True, 1),
        ([0, 1, 2], [1.0, 0.05, 2.0], True, None),
    ],
)
def test_ends_of_faces_and_third_members_pull_below_zero(owners, forces, presses, pulling):
    numbers = np.array(owners)
    grip = SimpleNamespace(
        contacts=PressedContacts(numbers, numbers, np.full((len(owners), 2), np.inf)),
        state=SimpleNamespace(normal_forces=np.array(forces)),
    )
    assert HeldGrip.presses.fget(grip) == presses
    assert HeldGrip.pulling.fget(grip) == pulling


def test_faces_are_tried_with_both_ends_first_then_with_one_of_each():
    cuts = np.tile([[np.inf, 0.1], [0.1, np.inf]], (2, 1))
    contacts = PressedContacts(np.array([3, 3, 5, 5]), np.arange(4), cuts)
    tried = [set(chosen.corners.tolist()) for chosen in _choices(contacts)]
    assert tried[0] == {0, 1, 2, 3}
    assert [len(corners) for corners in tried] == [4, 3, 3, 3, 3, 2, 2, 2, 2]
    assert len({frozenset(corners) for corners in tried}) == 9
    assert all(corners & {0, 1} and corners & {2, 3} for corners in tried)


def test_angles_of_contacts_are_those_of_the_normals_in_the_objects_frame():
    grip = held(Ellipse((0.25, 0.2)), 0.4)
    own = grip.state.normals * grip.body.turn.conjugate()
    assert np.exp(1j * grip.angles) == pytest.approx(own)


def test_an_object_that_has_settled_on_a_face_stays_where_it_is():
    grip = held(BOX, 0.0)
    assert len(grip.contacts.owners) == 3
    assert grip.body.pose.angle > 0.01
    again = attach_grip(HOME, grip.body, grip.members)
    assert again.body.pose == pytest.approx(grip.body.pose, abs=1e-5)
    assert again.state.normal_forces == pytest.approx(grip.state.normal_forces, rel=1e-3)
