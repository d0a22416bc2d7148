# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Force closure of a free object, and `held`, which implies it."""

from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros.core import ConvexObject, HoldStatus, settle_grasp, tangent_center
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
    forces = (contacts.normal_forces + 1j * contacts.friction_forces) * contacts.normals
    size = max(1.0, contacts.normal_forces.sum())
    assert sum(settled.normal_forces.values()) == pytest.approx(contacts.normal_forces.sum())
    assert sum(settled.friction_forces.values()) == pytest.approx(
        -contacts.friction_forces.sum(), abs=1e-9 * size
    )
    assert abs(-forces.sum() + complex(*load[:2])) < 1e-7 * size
    for name, normal in settled.normal_forces.items():
        assert normal > 0.0
        assert abs(settled.friction_forces[name]) <= friction * normal * (1.0 + 1e-12)


@pytest.mark.parametrize(
    ('shift', 'friction', 'closure', 'hold'),
    [
        (0.02, 0.8, True, HoldStatus.HELD),
        (0.04, 0.8, True, HoldStatus.HELD),
        (0.06, 0.8, True, HoldStatus.WRINKLES),
        (0.02, 0.3, False, HoldStatus.SLIPS),
        (-0.05, 0.8, False, HoldStatus.NO_CONTACT),
    ],
)
def test_a_tube_that_wrinkles_is_not_held_but_has_force_closure(shift, friction, closure, hold):
    body = ConvexObject.disc(tangent_center(HOME, 'south/P', 0.3, shift), 0.3)
    settled = settle_grasp(HOME, body, friction)
    assert (settled.force_closure, settled.hold) == (closure, hold)
    name, used = max(settled.utilisation.items(), key=lambda item: item[1], default=('', 0.0))
    words = f'{name} has {used:.3g} times its wrinkling moment'
    assert (used > 1.0) == (words in settled.reason) == (hold is HoldStatus.WRINKLES)


CENTER = tangent_center(HOME, 'north/Z', 0.3, 0.01)


@pytest.mark.parametrize(('away', 'hold'), [(0.0254, HoldStatus.HELD), (0.0256, HoldStatus.FAR)])
def test_an_equilibrium_is_at_most_a_quarter_of_the_diameter_away(away, hold):
    """Across the bisector, the equilibrium is in the middle, wherever the disc was given."""
    body = ConvexObject.disc((CENTER[0] + away, CENTER[1]), 0.3)
    settled = settle_grasp(HOME, body, 0.9, members=('north/P-Z', 'north/Z-R'))
    assert settled.hold is hold
    assert np.hypot(*settled.displacement[:2]) == pytest.approx(away, abs=1e-4)
    assert ('25.6 mm' in settled.reason) == (hold is HoldStatus.FAR)


def test_a_member_slips_below_the_required_friction():
    body = ConvexObject.disc(CENTER, 0.3)
    required = settle_grasp(HOME, body, 0.9).required_friction
    assert settle_grasp(HOME, body, 1.001 * required).held
    slips = settle_grasp(HOME, body, 0.9 * required)
    assert slips.hold is HoldStatus.SLIPS
    assert f'coefficient {required:.3g} against {0.9 * required:.3g}' in slips.reason
