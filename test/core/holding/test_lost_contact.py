# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The slip margin beyond the loss of contact, and its direction."""

from hypothesis import given, strategies
from isotruss_ros import core
from isotruss_ros.core import ConvexObject, settle_grasp, tangent_center
from isotruss_ros.viewer.arrows import arrow_of
import numpy as np
import pytest
import robots

HOME = robots.preset('nine_member').home
MEMBERS = ('north/P-Z', 'north/Z-R')
STEP = 1e-6


def settle(travel, away=0.0, pose=None, pull=(0.0, -2.0, 0.0)):
    """Return a disc that is so far from both members at home, set down elsewhere by `pose`."""
    body = core.place_between(HOME, MEMBERS, core.Disc(0.3), indentation=-away).body
    body = body if pose is None else body.moved_to(np.add(body.pose, pose))
    return core.settle_grasp(HOME.moved_to(travel), body, 0.8, pull, members=MEMBERS)


def test_gap_is_the_distance_to_contact():
    grasp = settle(np.zeros(6), 0.02)
    assert not grasp.held
    assert grasp.hold is core.HoldStatus.NO_CONTACT
    assert grasp.lost.gap == pytest.approx(0.02, abs=1e-6)
    assert settle(np.zeros(6), -0.01).lost is None


def test_slip_margin_without_contact_is_minus_the_external_wrench():
    stiffness = 34500.0 * 0.051
    for pull in ((0.0, 0.0, 0.0), (3.0, 4.0, 0.0), (0.0, 0.0, 0.3)):
        missing = np.linalg.norm(np.divide(pull, (1.0, 1.0, 0.15)))
        grasp = settle(np.zeros(6), 0.01, pull=pull)
        assert grasp.slip_margin == pytest.approx(-missing - 0.01 * stiffness, rel=1e-6)


def test_slip_margin_is_continuous_at_the_loss_of_contact():
    for pull in ((0.0, 0.0, 0.0), (0.0, -0.2, 0.0)):
        touching, apart = (
            settle(np.zeros(6), -1e-5, pull=pull),
            settle(np.zeros(6), 1e-5, pull=pull),
        )
        assert touching.slip_margin == pytest.approx(apart.slip_margin, abs=0.05)


@robots.examples(20)
@given(strategies.integers(0, 2**32 - 1))
def test_gradient_agrees_with_finite_differences(seed):
    rng = np.random.default_rng(seed)
    travel = rng.uniform(-0.01, 0.01, 6)
    pose = np.append(rng.uniform(-0.01, 0.01, 2), rng.uniform(-1.0, 1.0))
    grasp = settle(travel, 0.06, pose)
    gradient = core.grasp_gradient(grasp)
    assert gradient.pose[:, gradient.parameters.place] == pytest.approx(np.eye(3))
    for step in STEP * rng.choice([-1.0, 1.0], (1, 6)):
        ends = [settle(travel + sign * step, 0.06, pose).slip_margin for sign in (1.0, -1.0)]
        slope = gradient.slip_margin[gradient.parameters.rollers] @ step
        assert ends[0] - ends[1] == pytest.approx(2.0 * slope, rel=1e-4, abs=1e-7)
    for step in STEP * rng.choice([-1.0, 1.0], (1, 3)):
        ends = [settle(travel, 0.06, pose + sign * step).slip_margin for sign in (1.0, -1.0)]
        slope = gradient.slip_margin[gradient.parameters.place] @ step
        assert ends[0] - ends[1] == pytest.approx(2.0 * slope, rel=1e-4, abs=1e-7)


DISC = ConvexObject.disc(tangent_center(HOME, 'north/Z', 0.3, 0.01), 0.3, friction=0.8)
#: Of the slip margin: the equilibrium is linear about it only for small wrenches.
SHARE = 0.2


@pytest.fixture(scope='module')
def settled():
    """Return the disc pressed into the corner."""
    return settle_grasp(HOME, DISC)


def left_after(settled, direction):
    """Return the slip margin under a share of it in a direction [N]."""
    fx, fy, m = SHARE * settled.slip_margin * direction
    pulled = settle_grasp(HOME, DISC, external_wrench=(fx, fy, m * DISC.arm))
    return pulled.slip_margin / settled.slip_margin


def test_slip_margin_vanishes_under_its_wrench_along_the_slip_direction(settled):
    assert left_after(settled, settled.slip_direction) == pytest.approx(1.0 - SHARE, rel=0.05)


def test_slip_direction_minimises_the_margin(settled):
    least = left_after(settled, settled.slip_direction)
    others = np.random.default_rng(0).normal(size=(5, 3))
    for other in others / np.linalg.norm(others, axis=1, keepdims=True):
        assert left_after(settled, other) > least


@pytest.mark.parametrize(
    ('wrench', 'arrow'),
    [
        ((1.0, 0.0, 0.0), '→'),
        ((0.1, -5.0, 1.0), '↓'),
        ((0.1, 0.0, 0.5), '↺'),
        ((0.0, 0.0, 0.0), ''),
        ((np.nan, 0.0, 0.0), ''),
    ],
)
def test_the_arrow_points_along_the_larger_of_force_and_moment(wrench, arrow):
    assert arrow_of(wrench) == arrow
