# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Force closure and hold of a free object, and slip margins of lost contact."""

from dataclasses import replace

from held_grips import CORNER, HOME
from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros import core
from isotruss_ros.core import ConvexObject, HoldStatus, settle_grasp, tangent_center
from isotruss_ros.core.errors import GraspError
from isotruss_ros.viewer.arrows import arrow_of
import numpy as np
import pytest
import random_grips
import robots
from shapes import sampled

#: What may be wrong with an object that forces within the friction balance.
WRONG = {HoldStatus.FAR, HoldStatus.OTHER_CONTACT, HoldStatus.UNSTABLE, HoldStatus.WRINKLES}


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
    expected = -contacts.friction_forces.sum()
    assert sum(settled.friction_forces.values()) == pytest.approx(expected, abs=1e-9 * size)
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
    settled = settle_grasp(HOME, body, 0.9, members=CORNER)
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


STEP = 1e-6


def settle(travel, away=0.0, pose=None, pull=(0.0, -2.0, 0.0)):
    """Return a disc that is so far from both members at home, set down elsewhere by `pose`."""
    body = core.place_between(HOME, CORNER, core.Disc(0.3), indentation=-away).body
    body = body if pose is None else body.moved_to(np.add(body.pose, pose))
    return core.settle_grasp(HOME.moved_to(travel), body, 0.8, pull, members=CORNER)


def test_gap_is_the_distance_to_contact():
    grasp = settle(np.zeros(6), 0.02)
    assert not grasp.held
    assert grasp.hold is core.HoldStatus.NO_CONTACT
    assert grasp.lost.gap == pytest.approx(0.02, abs=1e-6)
    assert settle(np.zeros(6), -0.01).lost is None
    # Without named members it is that of the two nearest, at a module with 60 degrees.
    far = settle_grasp(HOME, ConvexObject.disc((CENTER[0], CENTER[1] - 0.25), 0.3))
    assert far.lost.gap == pytest.approx(0.12, abs=1e-6)


def test_slip_margin_without_contact_is_minus_the_external_wrench():
    stiffness = 34500.0 * 0.051
    for pull in ((0.0, 0.0, 0.0), (3.0, 4.0, 0.0), (0.0, 0.0, 0.3)):
        missing = np.linalg.norm(np.divide(pull, (1.0, 1.0, 0.15)))
        grasp = settle(np.zeros(6), 0.01, pull=pull)
        assert grasp.slip_margin == pytest.approx(-missing - 0.01 * stiffness, rel=1e-6)


def test_slip_margin_is_continuous_at_the_loss_of_contact():
    for pull in ((0.0, 0.0, 0.0), (0.0, -0.2, 0.0)):
        touching, apart = (settle(np.zeros(6), gap, pull=pull) for gap in (-1e-5, 1e-5))
        assert touching.slip_margin == pytest.approx(apart.slip_margin, abs=0.05)


@robots.examples(20)
@given(st.integers(0, 2**32 - 1))
def test_gradient_agrees_with_finite_differences(seed):
    rng = np.random.default_rng(seed)
    travel = rng.uniform(-0.01, 0.01, 6)
    pose = np.append(rng.uniform(-0.01, 0.01, 2), rng.uniform(-1.0, 1.0))
    grasp = settle(travel, 0.06, pose)
    gradient = core.grasp_gradient(grasp)
    assert gradient.pose[:, gradient.parameters.place] == pytest.approx(np.eye(3))
    rates = gradient.slip_margin
    by_rollers, by_place = rates[gradient.parameters.rollers], rates[gradient.parameters.place]
    steps = STEP * rng.choice([-1.0, 1.0], 9) * np.repeat([[1.0, 0.0], [0.0, 1.0]], (6, 3), axis=1)
    for turned, moved in (np.split(step, [6]) for step in steps):
        ends = [
            settle(travel + sign * turned, 0.06, pose + sign * moved).slip_margin
            for sign in (1.0, -1.0)
        ]
        slope = by_rollers @ turned + by_place @ moved
        assert ends[0] - ends[1] == pytest.approx(2.0 * slope, rel=1e-4, abs=1e-7)


DISC = ConvexObject.disc(tangent_center(HOME, 'north/Z', 0.3, 0.01), 0.3, friction=0.8)
#: Of the slip margin: the equilibrium is linear about it only for small wrenches.
SHARE = 0.2


@pytest.mark.parametrize('away', [0j, 0.1 + 0.05j])
def test_slip_margin_vanishes_under_its_wrench_along_the_slip_direction(away):
    # The middle of the disc is away from its frame.
    shape, center = sampled(DISC.shape, 48, 0.1, away), DISC.center - away
    body = replace(DISC, shape=shape, pose=(center.real, center.imag, 0.0))
    grasp = settle_grasp(HOME, body)
    margin, body = grasp.slip_margin, grasp.equilibrium.measured
    fx, fy, m = SHARE * margin * grasp.slip_direction
    pulled = settle_grasp(HOME, body, external_wrench=(fx, fy, m * body.arm))
    assert pulled.slip_margin == pytest.approx((1.0 - SHARE) * margin, rel=0.05)


@pytest.mark.parametrize(
    ('wrench', 'arrow'),
    [
        ((1.0, 0.0, 0.0), '→'),
        ((0.1, -5.0, 1.0), '↓'),
        ((0.1, 0.0, 0.5), '↺'),
        ((0.1, 0.0, -0.5), '↻'),
        ((0.0, 0.0, 0.0), ''),
        ((np.nan, 0.0, 0.0), ''),
    ],
)
def test_the_arrow_points_along_the_larger_of_force_and_moment(wrench, arrow):
    assert arrow_of(wrench) == arrow
