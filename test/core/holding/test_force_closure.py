# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Force closure of a free object, and `held`, which implies it."""

from held_grips import BOX
from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros.core import (
    ConvexObject,
    HoldStatus,
    place_between,
    settle_grasp,
    tangent_center,
)
from isotruss_ros.core.errors import GraspError
import numpy as np
import pytest
import random_grips
import robots
from robots import preset

HOME = preset('nine_member').home
#: What may be wrong with an object that forces within the friction balance.
WRONG = {
    HoldStatus.FAR,
    HoldStatus.OTHER_CONTACT,
    HoldStatus.UNSTABLE,
    HoldStatus.WRINKLES,
}


@given(
    robots.robots(),
    robots.generators(),
    st.sampled_from(['module', 'tubes', 'tube']),
    st.sampled_from([2, 2, 3]),
    st.booleans(),
)
@robots.examples(150)
def test_held_implies_force_closure(robot, rng, kind, count, flat):
    config, grip = random_grips.random_convex_grip(robot, rng, kind, count, flat)
    if grip is None:
        return
    x, y, angle = grip.body.pose
    body = grip.body.moved_to((*np.add((x, y), 0.01 * rng.normal(size=2)), angle))
    friction, load = 10.0 ** rng.uniform(-1.0, 0.5), rng.normal(size=3) * [2.0, 2.0, 0.2]
    try:
        settled = settle_grasp(config, body, friction, load, members=grip.members)
    except GraspError:
        return  # the members no longer surround it
    assert settled.held == (settled.force_closure and settled.hold not in WRONG)
    if not settled.force_closure:
        return
    contacts = settled.equilibrium.state
    pressing = settled.equilibrium.state.normal_forces
    forces = (pressing + 1j * contacts.friction_forces) * contacts.normals
    size = max(1.0, pressing.sum())
    assert abs(-forces.sum() + complex(*load[:2])) < 1e-7 * size
    for name, normal in settled.normal_forces.items():
        assert normal > 0.0
        assert abs(settled.friction_forces[name]) <= friction * normal * (1.0 + 1e-12)


@pytest.mark.parametrize(
    ('shift', 'friction', 'closure', 'hold'),
    [
        (0.02, 0.8, True, HoldStatus.HELD),
        (0.06, 0.8, True, HoldStatus.WRINKLES),
        (0.02, 0.3, False, HoldStatus.SLIPS),
        (-0.05, 0.8, False, HoldStatus.NO_CONTACT),
    ],
)
def test_a_wrinkling_tube_ends_held_and_leaves_force_closure(shift, friction, closure, hold):
    body = ConvexObject.disc(tangent_center(HOME, 'south/P', 0.3, shift), 0.3)
    settled = settle_grasp(HOME, body, friction)
    assert (settled.force_closure, settled.hold) == (closure, hold)


@pytest.mark.parametrize('angle', [0.0, 0.15, 0.5])
def test_slip_margin_of_a_held_box_is_positive_up_to_its_squeeze(angle):
    members = ('south/P-Q', 'north/R-P')
    body = place_between(HOME, members, BOX, angle=angle, indentation=0.01).body
    settled = settle_grasp(HOME, body, 1.3, members=members)
    assert settled.held
    assert 0.0 < settled.slip_margin < 1.3 * sum(settled.normal_forces.values())
