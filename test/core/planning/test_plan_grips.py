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
from isotruss_ros.core.planning.facing import balances, find_facing, friction_angles
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


def test_an_ellipse_is_held_along_its_axes_without_friction():
    body = ConvexObject(Ellipse((0.2, 0.1)), (0.0, 0.0, 0.1234))
    normals = np.array([1.0, -1.0 + 0j])
    facing = find_facing(body, normals, 1e-9, RADIUS)
    assert facing == pytest.approx(normals * body.turn, abs=1e-9)


def test_three_members_balance_if_they_surround_the_object():
    around = np.exp(2j * np.pi * np.array([0.05, 0.4, 0.7]))
    aside = np.exp(1j * np.array([0.0, 1.0, 2.0]))
    body = ConvexObject(Disc(0.3), (0.3, 0.1, 0.7))
    assert balances(body, around, 0.05, RADIUS)
    assert not balances(body, aside, 0.4, RADIUS)


def test_the_grip_that_is_found_holds_the_object(plan):
    body, needs, found = plan
    (grasp,) = found
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
    assert 'between south/P-Q, east/Q-R, north/R-P' in plan_in_words(found).replace("'", '')
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
    found = plan_grasps(HOME, body, needs, max_rounds=1)
    assert not found.grasps
    assert re.search(words, plan_in_words(found))


def test_the_friction_of_the_object_counts():
    body = ConvexObject(Disc(0.6), (*HOLE, 0.0), friction=0.01)
    found = plan_grasps(HOME, body, GraspRequirements(count=1), max_rounds=1, thorough=False)
    assert all(grasp.grip.friction == 0.01 for grasp in found)
    assert all(grasp.slip_margin < 0.5 for grasp in found)
