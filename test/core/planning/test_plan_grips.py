# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The search for grips of convex objects by any two members, or three."""

import re

from isotruss_ros.core import (
    ConvexObject,
    Disc,
    Ellipse,
    GraspRequirements,
    plan_grasps,
    Polygon,
    settle_grasp,
)
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.planning.facing import balances, friction_angles
from isotruss_ros.core.planning.grasp_plan import export_figures, plan_in_words
import numpy as np
import pytest
from robots import preset

ROBOT = preset('nine_member')
HOME = ROBOT.home
HOLE = (0.716, -0.4134)  # between the three tubes
BOX = Polygon([(-0.15, -0.1), (0.15, -0.1), (0.15, 0.1), (-0.15, 0.1)], corner_radius=0.02)
#: Of the tubes [m].
RADIUS = 0.5 * HOME.robot.description.tube_diameter
SHAPES = [BOX, Ellipse((0.2, 0.12)), Disc(0.3), Polygon([(0.0, 0.0), (0.3, 0.05), (0.1, 0.25)])]


@pytest.fixture(scope='module')
def plan():
    """Plan the grip of a disc that only three members of different tubes reach around."""
    needs = GraspRequirements(count=1, squeeze=12.0)
    body = ConvexObject(Disc(0.6), (*HOLE, 0.2))
    return body, needs, plan_grasps(HOME, body, needs, max_rounds=1)


@pytest.mark.parametrize('shape', SHAPES)
def test_two_members_balance_from_the_friction_angle_on(shape):
    rng = np.random.default_rng(0)
    for _ in range(60):
        body = ConvexObject(shape, (*rng.normal(size=2), rng.uniform(0.0, 6.0)))
        normals = np.exp(1j * rng.uniform(0.0, 2.0 * np.pi)) * np.array([1.0, -1.0])
        normals[1] *= np.exp(1j * rng.uniform(-0.8, 0.8))
        angle = float(friction_angles(body, normals[:1], normals[1:], RADIUS)[0])
        if angle < 1.4:
            assert balances(body, normals, angle + 1e-6, RADIUS)
            assert not balances(body, normals, angle - 1e-6, RADIUS)


def test_the_planned_grip_holds_the_object(plan):
    body, needs, result = plan
    (grasp,) = result
    assert grasp.module is None
    assert set(grasp.grip.members) == {'south/P-Q', 'east/Q-R', 'north/R-P'}
    assert set(grasp.members) == set(grasp.grip.members)
    assert grasp.grip.body.shape == body.shape
    assert abs(grasp.grip.center - body.center) < 1e-3
    settled = settle_grasp(grasp.config, body, needs.friction, members=grasp.grip.members)
    assert settled.held
    assert grasp.slip_margin == pytest.approx(settled.slip_margin, rel=0.1)
    assert grasp.score == grasp.slip_margin > 2.0
    assert grasp.squeeze == pytest.approx(needs.squeeze, rel=0.02)
    assert sum(settled.normal_forces.values()) / 3.0 == pytest.approx(grasp.squeeze, rel=0.05)
    assert 'between south/P-Q, east/Q-R, north/R-P' in plan_in_words(result).replace("'", '')
    assert export_figures(grasp)['module'] == ''


SIDES = ('south/P-Q', 'north/R-P')  # of two tubes, that meet at no module


def test_only_the_members_that_are_named_grip():
    body = ConvexObject(Polygon([(-0.25, -0.2), (0.25, -0.2), (0.25, 0.2), (-0.25, 0.2)], 0.02))
    body = body.moved_to((0.54, -0.31, -0.5))
    needs = GraspRequirements(friction=0.9, squeeze=12.0, members=SIDES[::-1], count=1)
    (grasp,) = plan_grasps(HOME, body, needs, thorough=False)
    assert set(grasp.grip.members) == set(SIDES)
    assert settle_grasp(grasp.config, grasp.grip.body, 0.9, members=SIDES).held


def test_members_that_the_robot_does_not_have_are_refused():
    needs = GraspRequirements(members=('north/Z-R', 'north/X-Y'))
    with pytest.raises(GraspError, match="'north/X-Y': robot nine_member has no such members"):
        plan_grasps(HOME, ConvexObject(BOX), needs)


@pytest.mark.parametrize(
    ('place', 'members', 'words'),
    [
        ((4.0, 1.0), SIDES, 'enclosed: no members'),
        ((0.716, 0.5), SIDES, 'members: [01] of the 2 required members are visible'),
        (HOLE, (*SIDES, 'east/Q-R'), 'opposed: no near directions of the members balance'),
    ],
)
def test_members_without_a_grasp_have_the_reason(place, members, words):
    needs = GraspRequirements(members=members, friction=0.01)
    body = ConvexObject(BOX, (*place, 0.3))
    result = plan_grasps(HOME, body, needs, max_rounds=1)
    assert not result.grasps
    assert re.search(words, plan_in_words(result))
