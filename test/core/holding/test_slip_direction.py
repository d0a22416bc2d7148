# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The direction in which a grasp bears the least, and its arrow."""

from isotruss_ros.core import ConvexObject, settle_grasp, tangent_center
from isotruss_ros.viewer.arrows import arrow_of
import numpy as np
import pytest
from robots import preset

HOME = preset('nine_member').home
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
