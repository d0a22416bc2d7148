# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Rare ends of the contact problem and of equilibria: not solved, indifferent, not near."""

from apart_grips import APART
from grips import gripped
from held_grips import BOX, held, HOME, numbers
from isotruss_ros.core import (
    analyze_grasp,
    ConvexObject,
    Disc,
    HoldStatus,
    place_between,
    settle_grasp,
)
from isotruss_ros.core.contact.contact import estimate_contact
from isotruss_ros.core.contact.place_points import find_contact_points
from isotruss_ros.core.contact.surfaces import surface_of
from isotruss_ros.core.holding import grip_response
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.statics.structure import structure_of
import numpy as np
import pytest

CONFIG, CYLINDER = gripped(35.0, squeeze=0.08)
MODEL = attach_grip(CONFIG, CYLINDER)
AROUND = ('south/P-Q', 'east/Q-R', 'north/R-P')


# Contact


def points_of(body):
    """Return points that an object could touch, and what they meet."""
    surface = surface_of(body, 0.5 * CONFIG.robot.description.tube_diameter)
    return find_contact_points(structure_of(CONFIG), surface, 0.01), surface


def test_an_estimate_presses_along_its_normals():
    points, surface = points_of(CYLINDER)
    found = estimate_contact(points, surface)
    assert found.forces.sum() > 1.0
    assert found.push == pytest.approx(found.forces * found.normals)


def test_a_box_beside_the_tubes_touches_nothing():
    body = place_between(HOME, APART, BOX, angle=0.2, indentation=-1e-4).body
    found = analyze_grasp(HOME, body)
    assert not found.normal_forces.any()
    assert not found.stiffness.any()
    assert not found.force_closure


# Equilibria


def test_the_arm_of_a_disc_is_its_radius():
    assert MODEL.arm == pytest.approx(0.5 * CYLINDER.shape.diameter)


def test_a_load_changes_the_squeeze_as_the_response_says():
    step = 1e-3 * np.eye(3)
    for column, wrench in enumerate(step):
        after, before = (roll_grip(MODEL, CONFIG, sign * wrench) for sign in (1.0, -1.0))
        slope = (after.squeeze - before.squeeze) / 2e-3
        arm = MODEL.arm if column == 2 else 1.0
        assert MODEL.response.squeeze[column] / arm == pytest.approx(slope, abs=2e-3)


def test_what_a_wrench_moves_without_bound_is_indifferent():
    assert grip_response.solve_change(np.zeros((4, 4)), np.eye(4, 3)) is None
    # The pose does not answer to one of the wrenches.
    assert grip_response.solve_change(np.eye(4), np.diag([1.0, 1.0, 0.0, 0.0])[:, :3]) is None
    found = grip_response.solve_change(2.0 * np.eye(4), np.eye(4, 3))
    assert found == pytest.approx(0.5 * np.eye(4, 3))


@pytest.mark.parametrize('held', [MODEL, held(BOX, 0.2)], ids=['disc', 'box'])
def test_there_is_no_equilibrium_under_any_load(held):
    pulled = 1e6 * np.array([0.3, -0.8, 0.0])
    assert roll_grip(held, held.config, pulled) is None


def test_a_box_that_is_pulled_away_has_no_balance():
    body = held(BOX, 0.2).body
    found = attach_grip(HOME, body, numbers(APART), np.array([0.0, 1e6, 0.0]))
    assert found is HoldStatus.NO_BALANCE


def test_a_third_member_in_contact_is_named():
    body = place_between(HOME, AROUND, Disc(0.83), indentation=0.01).body
    there = ConvexObject(body.shape, body.pose)
    found = settle_grasp(HOME, there, 2.0, members=AROUND[:2])
    assert found.hold is HoldStatus.OTHER_CONTACT
    assert AROUND[2] in found.reason
