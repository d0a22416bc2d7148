# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plans by any two members, or three; their paths, violations and requirements."""

import copy
import json
from pathlib import Path
import re

from held_grips import APART, BOX, HOME
from hypothesis import given
from isotruss_ros import core
from isotruss_ros.core import ConvexObject, GraspRequirements, plan_grasps
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.model.robot_file import describe_robot
from isotruss_ros.core.paths.roller_trajectory import RollerTrajectory
from isotruss_ros.core.planning import violations
from isotruss_ros.core.planning.facing import balances, friction_angles
from isotruss_ros.core.planning.grasp_plan import (
    export_figures,
    export_path,
    path_times,
    plan_in_words,
)
from nightly import some_now
import numpy as np
import pytest
from robots import examples, generators, preset_document
from shapes import BRICK, SHAPES

HOLE = (0.716, -0.4134)  # between the three tubes
#: Of the tubes [m].
RADIUS = 0.5 * HOME.robot.description.tube_diameter


@pytest.fixture(scope='module')
def plan():
    """Plan the grip of a disc that only three members of different tubes reach around."""
    needs = core.GraspRequirements(count=1, squeeze=12.0)
    body = core.ConvexObject(core.Disc(0.6), (*HOLE, 0.2))
    return body, needs, core.plan_grasps(HOME, body, needs, max_rounds=1)


@pytest.mark.parametrize('shape', SHAPES)
def test_two_members_balance_from_the_friction_angle_on(shape):
    rng = np.random.default_rng(0)
    for _ in range(60):
        body = core.ConvexObject(shape, (*rng.normal(size=2), rng.uniform(0.0, 6.0)))
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
    settled = core.settle_grasp(grasp.config, body, needs.friction, members=grasp.grip.members)
    assert settled.held
    assert grasp.slip_margin == pytest.approx(settled.slip_margin, rel=0.1)
    assert grasp.score == grasp.slip_margin > 2.0
    assert grasp.squeeze == pytest.approx(needs.squeeze, rel=0.02)
    assert sum(settled.normal_forces.values()) / 3.0 == pytest.approx(grasp.squeeze, rel=0.05)
    assert 'between south/P-Q, east/Q-R, north/R-P' in plan_in_words(result).replace("'", '')
    assert export_figures(grasp)['module'] == ''


def test_only_the_members_that_are_named_grip():
    body = core.ConvexObject(BOX, (0.54, -0.31, -0.5))
    needs = core.GraspRequirements(friction=0.9, squeeze=12.0, members=APART[::-1], count=1)
    (grasp,) = core.plan_grasps(HOME, body, needs, thorough=False)
    assert set(grasp.grip.members) == set(APART)
    assert core.settle_grasp(grasp.config, grasp.grip.body, 0.9, members=APART).held


def test_members_that_the_robot_does_not_have_are_refused():
    needs = core.GraspRequirements(members=('north/Z-R', 'north/X-Y'))
    with pytest.raises(GraspError, match="'north/X-Y': robot nine_member has no such members"):
        core.plan_grasps(HOME, core.ConvexObject(BRICK), needs)


@pytest.mark.parametrize(
    ('place', 'members', 'words'),
    [
        ((4.0, 1.0), APART, 'enclosed: no members'),
        ((0.716, 0.5), APART, 'members: [01] of the 2 required members are visible'),
        (HOLE, (*APART, 'east/Q-R'), 'opposed: no near directions of the members balance'),
    ],
)
def test_members_without_a_grasp_have_the_reason(place, members, words):
    needs = core.GraspRequirements(members=members, friction=0.01)
    body = core.ConvexObject(BRICK, (*place, 0.3))
    result = core.plan_grasps(HOME, body, needs, max_rounds=1)
    assert not result.grasps
    assert re.search(words, plan_in_words(result))


DOCUMENT = preset_document('nine_member')
MIDDLE = complex(*np.mean(list(DOCUMENT['joints'].values()), axis=0))
FLAT_BOX = core.Polygon([(0.15, 0.1), (-0.15, 0.1), (-0.15, -0.1), (0.15, -0.1)])
NAMES = dict(zip('PQRXYZ', ('last', 'B', 'm', 'a', 'zz', 'c'), strict=True))
NAMES |= {'south': 'u', 'east': 'Z', 'north': 'b'}
#: Shapes with the places of their centres. From the first two, members are equally far; faces of
#: the first box are parallel to a member.
OBJECTS = [
    (core.Disc(0.3), 0.2j),
    (core.Disc(0.5), 0.1 + 0.05j),
    (FLAT_BOX, 0.2j),
    (FLAT_BOX, 0.12 + 0.03j),
    (core.Ellipse((0.2, 0.14)), 0.1j),
]


def plan_moved(shape, away, shift=0j, quarters=0, names=None):
    """Return score, squeeze and travel (n, 3) of the grasps, and the names of their members."""
    turn, document, names = 1j**quarters, copy.deepcopy(DOCUMENT), names or {}
    document['joints'] = {
        name: [(z := turn * complex(*place) + shift).real, z.imag]
        for name, place in document['joints'].items()
    }
    axes = {'x': 'y', 'y': 'x'} if quarters % 2 else {}
    document['supports'] = {
        name: [axes.get(axis, axis) for axis in held]
        for name, held in document['supports'].items()
    }
    text = re.sub(r'\w+', lambda word: names.get(word[0], word[0]), json.dumps(document))
    robot = core.Robot(describe_robot(Path('other.yaml'), json.loads(text)))
    place = turn * (MIDDLE + away) + shift
    body = core.ConvexObject(shape, (place.real, place.imag, 0.5 * np.pi * quarters))
    needs = core.GraspRequirements(friction=0.6)
    grasps = core.plan_grasps(robot.home, body, needs, max_rounds=1).grasps
    order = robot.member_names
    members = [[order.index(name) for name in grasp.members] for grasp in grasps]
    return np.array([(grasp.score, grasp.squeeze, grasp.travel) for grasp in grasps]), members


@pytest.mark.parametrize('number', some_now(range(len(OBJECTS))))
def test_plans_depend_on_no_frame_or_name(number):
    values, members = plan_moved(*OBJECTS[number])
    others, same = plan_moved(*OBJECTS[number], shift=0.1 + 0.2j, quarters=1, names=NAMES)
    assert same == members
    assert others == pytest.approx(values, rel=1e-9)
    assert len(values)


SIDES = ('south/P-Q', 'north/R-P')


@pytest.fixture(scope='module')
def grasp():
    needs = GraspRequirements(module='north/Z', squeeze=10.0, count=1)
    return plan_grasps(HOME, ConvexObject.disc((0.6, 0.3), 0.3), needs, thorough=False)[0]


@examples(50)
@given(generators())
def test_path_times_keep_the_acceleration_of_the_rollers(rng):
    robot = HOME.robot
    steps = rng.uniform(-0.1, 0.1, (rng.integers(1, 20), 6)) * 10.0 ** rng.uniform(-3.0, 0.0)
    path = np.vstack([np.zeros(6), np.cumsum(steps, axis=0)])
    times = path_times(path, robot.description, rng.random(len(steps)) < 0.3)
    RollerTrajectory(robot, path, times)


def test_a_path_is_slow_from_two_waypoints_before_the_touch_on(grasp):
    exported = export_path(grasp)
    assert exported['touch'] == grasp.touch > 2
    assert np.array(exported['path']) == pytest.approx(grasp.path)
    longest = np.abs(np.diff(grasp.path, axis=0)).max(axis=1)
    speeds = longest / np.diff(exported['times'])
    full = HOME.robot.description.max_speed
    fast = np.arange(len(speeds)) < grasp.touch - 2
    assert speeds == pytest.approx(np.minimum(np.where(fast, full, 0.25 * full), longest / 0.01))


def test_the_closest_violation_is_the_latest_one_and_of_bounds_the_nearest():
    ordered = [
        violations.Violation('no step', 0.0, 0.0),
        violations.Violation('free', -0.1, 0.0),
        violations.Violation('reach', 0.1, 0.0),
        violations.Violation('held', 0.0, 1.0),
        violations.Violation('min_slip_margin', -1.0, 0.5),
        violations.Violation('max_total_force', 16.0, 8.0),
        violations.Violation('min_slip_margin', 0.2, 0.25),
    ]
    for several in (ordered, ordered[::-1]):
        tally = violations.SearchTally()
        for violation in several:
            tally.add(violations.SearchTally(2, 1, violation))
        assert tally == violations.SearchTally(14, 7, ordered[-1])
    distances = [violation.distance for violation in ordered]
    assert distances == sorted(distances, reverse=True)


def test_every_violation_has_words():
    for name in violations.SENTENCES_BY_REQUIREMENT | violations.BOUNDS:
        words = str(violations.Violation(name, 0.125, 0.25))
        assert words.startswith(f'{name}: ')
        assert ('12% of its path' in words) == (name == 'carry')
        assert '{' not in words


@pytest.mark.parametrize(
    ('values', 'words'),
    [
        ({'friction': -0.1}, 'friction'),
        ({'min_slip_margin': float('inf')}, 'min_slip_margin'),
        ({'max_contact_force': -1.0}, 'max_contact_force'),
        ({'external_wrench': (0.0, 1.0)}, 'external_wrench'),
        ({'direction': (0.0, 0.0, 0.0), 'measure': 'stiffness'}, 'direction'),
        ({'measure': 'beauty'}, 'measure'),
        ({'squeeze': 0.0}, 'squeeze'),
        ({'count': 0}, 'count'),
        ({'min_length': '1'}, 'min_length'),
        ({'members': 'north/Z-R'}, 'members .*north/Z-R.*: must be two or three different'),
        (
            {'members': SIDES, 'module': 'north/Z'},
            "module: 'north/Z', and members .*: only one of the two",
        ),
    ],
)
def test_requirements_out_of_range_are_refused(values, words):
    with pytest.raises(GraspError, match=words):
        GraspRequirements(**values)
