# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contacts of a grip: which are tried, which pull, and at which wrench a member slips first."""

import itertools

from held_grips import BOX, held, HOME
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.grip_response import GripResponse, slip_planes
from isotruss_ros.core.holding.pressed_contacts import ContactForces
import numpy as np
import pytest


def response_of(pose, forces, arm, normal, friction, owners):
    """Return a response to wrenches of contacts whose forces change by (2k, 3) a wrench."""
    unknowns = np.concatenate([np.zeros(3 + 2 * len(normal)), normal, friction])
    state = ContactForces(unknowns, np.zeros(len(normal), dtype=complex), None, None)
    change = np.vstack([pose, np.zeros((len(forces), 3)), forces])
    none = np.zeros(0, dtype=int), np.zeros((len(change), 0))
    return GripResponse(state, owners, change, np.zeros(len(change)), *none, arm, np.eye(3))


@pytest.mark.parametrize('arm', [0.2, 1.0])
@pytest.mark.parametrize(('one', 'other'), list(itertools.permutations(range(3), 2)))
@pytest.mark.parametrize('share', [0.98, 1.02])
def test_an_equilibrium_is_stable_where_every_displacement_takes_work(one, other, share, arm):
    # Displacements by wrenches, angles times the arm: of two kinds the mean of what each does to
    # the other may not be more than what both do to themselves.
    even = np.eye(3)
    even[one, other], even[other, one] = 2.0 * share + 0.25, -0.25
    pose = even / [[1.0], [1.0], [arm]]
    response = response_of(pose, np.zeros((4, 3)), arm, np.ones(2), np.zeros(2), np.arange(2))
    assert response.stable == (share < 1.0)
    # Wrenches (fx, fy, m / arm).
    wrench = response.stiffness @ pose / [[1.0], [1.0], [arm]]
    assert wrench == pytest.approx(np.eye(3))


def test_a_member_slips_by_the_sums_over_its_contacts():
    # One end of the face rubs by more than its own normal force bears; the other one helps.
    normal, friction = np.array([1.0, 3.0, 4.0]), np.array([0.9, 0.3, 0.2])
    by_normal = np.tile([0.0, 0.0, 0.1], (3, 1))
    by_friction = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    forces, owners = np.vstack([by_normal, by_friction]), np.array([0, 0, 1])
    planes = slip_planes(response_of(np.eye(3), forces, 0.2, normal, friction, owners), 0.5)
    # mu N - T of the first member is 0.5 * 4 - 1.2, and falls by 2 fx - 0.5 * 0.2 m / arm.
    size = np.hypot(2.0, 0.1)
    assert planes.margin == pytest.approx(0.8 / size)
    assert planes.direction == pytest.approx(np.array([2.0, 0.0, -0.1]) / size)
    # The other way round as well.
    planes = slip_planes(response_of(np.eye(3), forces, 0.2, normal, -friction, owners), 0.5)
    assert planes.margin == pytest.approx(0.8 / size)
    assert planes.direction[0] == pytest.approx(-2.0 / size)


def test_settling_on_a_face_is_idempotent():
    grip = held(BOX, 0.0)
    assert len(grip.contacts.owners) == 3
    assert grip.body.pose.angle > 0.01
    again = attach_grip(HOME, grip.body, grip.members)
    # But for the step of the tables of dents.
    assert np.array(again.body.pose) == pytest.approx(np.array(grip.body.pose), abs=5e-4)
    assert again.state.normal_forces == pytest.approx(grip.state.normal_forces, rel=1e-2)
