# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contacts of a grip: which are tried, which pull, and at which wrench a member slips first."""

from functools import partial
import itertools
from types import SimpleNamespace

from held_grips import BOX, held, HOME
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.contact_forces import ContactForces, GripResponse
from isotruss_ros.core.holding.held_grip import HeldGrip
import numpy as np
import pytest


def response_of(pose, forces, squeeze, arm):
    """Return a response to wrenches, of which members that move change nothing."""
    rest, no_ends = np.zeros((len(forces), 3)), np.zeros(0, dtype=int)
    change = np.vstack([pose, rest, forces])
    return GripResponse(change, squeeze, arm, 0.0, no_ends, np.zeros((len(change), 0)))


def grip_of(normal, friction, owners, response):
    """Return what the slip margin of a grip is of."""
    unknowns = np.concatenate([np.zeros(3 + 2 * len(normal)), normal, friction])
    state = ContactForces(unknowns, np.zeros(len(normal), dtype=complex), None, None)
    contacts = SimpleNamespace(owners=owners)
    grip = SimpleNamespace(
        state=state, contacts=contacts, response=response, _slip_rows={}, about_middle=np.eye(3)
    )
    for name in ('slip_reserves', 'slip_rows', '_reserves'):
        setattr(grip, name, partial(getattr(HeldGrip, name), grip))
    return grip


@pytest.mark.parametrize('arm', [0.2, 1.0])
@pytest.mark.parametrize(('one', 'other'), itertools.permutations(range(3), 2))
@pytest.mark.parametrize('share', [0.98, 1.02])
def test_an_equilibrium_is_stable_where_every_displacement_takes_work(one, other, share, arm):
    # Displacements by wrenches, angles times the arm: of two kinds the mean of what each does to
    # the other may not be more than what both do to themselves.
    even = np.eye(3)
    even[one, other], even[other, one] = 2.0 * share + 0.25, -0.25
    pose = even / [[1.0], [1.0], [arm]]
    response = response_of(pose, np.zeros((4, 3)), np.zeros(3), arm)
    assert response.stable == (share < 1.0)
    # Wrenches (fx, fy, m / arm).
    wrench = response.stiffness @ pose / [[1.0], [1.0], [arm]]
    assert wrench == pytest.approx(np.eye(3))


def test_a_member_slips_by_the_sums_over_its_contacts():
    # One end of the face rubs by more than its own normal force bears; the other one helps.
    normal, friction = np.array([1.0, 3.0, 4.0]), np.array([0.9, 0.3, 0.2])
    by_normal = np.tile([0.0, 0.0, 0.1], (3, 1))
    by_friction = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    response = response_of(np.eye(3), np.vstack([by_normal, by_friction]), np.zeros(3), 0.2)
    owners = np.array([0, 0, 1])
    # mu N - T of the first member is 0.5 * 4 - 1.2, and falls by 2 fx - 0.5 * 0.2 m / arm.
    size = np.hypot(2.0, 0.1)
    grip = grip_of(normal, friction, owners, response)
    assert HeldGrip.slip_margin(grip, 0.5) == pytest.approx(0.8 / size)
    direction = np.array([2.0, 0.0, -0.1]) / size
    assert HeldGrip.weakest_direction(grip, 0.5) == pytest.approx(direction)
    # The other way round as well.
    other_way = grip_of(normal, -friction, owners, response)
    assert HeldGrip.slip_margin(other_way, 0.5) == pytest.approx(0.8 / size)
    assert HeldGrip.weakest_direction(other_way, 0.5)[0] == pytest.approx(-direction[0])


def test_settling_on_a_face_is_idempotent():
    grip = held(BOX, 0.0)
    assert len(grip.contacts.owners) == 3
    assert grip.body.pose.angle > 0.01
    again = attach_grip(HOME, grip.body, grip.members)
    # But for the step of the tables of dents.
    assert np.array(again.body.pose) == pytest.approx(np.array(grip.body.pose), abs=5e-4)
    assert again.state.normal_forces == pytest.approx(grip.state.normal_forces, rel=1e-2)
