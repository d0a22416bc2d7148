# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plans by any two members, or three: paths, violations, requirements, and obstacles."""

import copy
import json
import math
from pathlib import Path
import re

from held_grips import APART, BOX, HOME
from hypothesis import given
from isotruss_ros import core
from isotruss_ros.core import (
    ConvexObject,
    GraspRequirements,
    Grip,
    load_robot,
    Obstacle,
    plan_grasps,
    plan_path,
    RollingGrip,
    settle_grasp,
    tangent_center,
)
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.distances import collision_model
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.model.convex_object import segment_gaps
from isotruss_ros.core.model.robot_file import describe_robot
from isotruss_ros.core.paths.roller_trajectory import RollerTrajectory
from isotruss_ros.core.planning import grasp_plan, violations
from isotruss_ros.core.planning.facing import balances, friction_angles
from isotruss_ros.core.planning.foresee_path import foresee_path
from isotruss_ros.core.planning.path_tree import Node, PathTree
from isotruss_ros.core.planning.release import plan_release
from nightly import some_now
import numpy as np
import pytest
from random_grips import toward
from robots import examples, generators, member_ends, preset_document
from rooms import clearance
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
    assert 'between south/P-Q, east/Q-R, north/R-P' in grasp_plan.plan_in_words(result).replace(
        "'", ''
    )
    assert grasp_plan.export_figures(grasp)['module'] == ''


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
    assert re.search(words, grasp_plan.plan_in_words(result))


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
    times = grasp_plan.path_times(path, robot.description, rng.random(len(steps)) < 0.3)
    RollerTrajectory(robot, path, times)


def test_a_path_is_slow_from_two_waypoints_before_the_touch_on(grasp):
    exported = grasp_plan.export_path(grasp)
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


ROBOT = load_robot('nine_member')
BODY = ConvexObject.disc(tangent_center(ROBOT.home, 'north/Z', 0.3, 0.02), 0.3, 0.8)
GRIP = Grip.at_module(ROBOT, 'north/Z', BODY)
HELD = settle_grasp(ROBOT.home, BODY).equilibrium
POST = Obstacle('post', ConvexObject.disc((HELD.pose.x + 0.089, HELD.pose.y - 0.185), 0.063))
BEHIND = np.add(HELD.pose, (0.329, 0.022, 0.615))
#: Posts within the loop of the tube that holds the object, and a goal beyond them.
POSTS = [
    Obstacle(f'post {name}', ConvexObject.disc((HELD.pose.x + dx, HELD.pose.y + dy), 0.1))
    for name, dx, dy in (('left', -0.2, -0.2), ('middle', 0.0, -0.27), ('right', 0.2, -0.2))
]
BEYOND = np.add(HELD.pose, (0.0, -0.55, 0.0))


def test_path_is_straight_where_the_straight_line_is_accepted():
    goal = np.add(HELD.pose, (-0.04, -0.01, 0.1))
    plan = plan_path(ROBOT, GRIP, goal, [POST])
    assert plan.why == ''
    assert np.array(plan) == pytest.approx(np.array([HELD.pose, goal]))


def test_path_leads_around_an_obstacle_on_the_straight_line():
    plan = plan_path(ROBOT.home, GRIP, BEHIND, [POST])
    assert len(plan) > 2
    assert plan.poses[0] == pytest.approx(np.array(HELD.pose))
    assert plan.poses[-1] == pytest.approx(BEHIND)
    foresight = foresee_path(HELD, 0.8, plan.poses, obstacles=[POST])
    assert foresight.why == ''
    # The loop keeps its bound of 20 mm and a safety margin of 1 mm.
    assert min(clearance(grip, [POST]) for grip in foresight.grips) > 0.0209


#: A configuration from which limits of the robot end the straight line before the goal.
BENT = ROBOT.configuration([-0.341, 0.233, 0.417, 0.201, -0.205, -0.174])
BENT_GRIP = Grip.at_module(ROBOT, 'north/P', ConvexObject.disc((0.959, 0.218), 0.3, 0.8))
BEYOND_LIMITS = (0.98, 0.08, -1.441)


def test_path_leads_around_limits_of_the_robot():
    plan = plan_path(BENT, BENT_GRIP, BEYOND_LIMITS)
    assert len(plan) > 2
    assert plan.poses[-1] == pytest.approx(BEYOND_LIMITS)


def test_a_path_keeps_the_direction_of_a_turn_of_more_than_half_a_turn():
    rolling = RollingGrip.attach(ROBOT.home, GRIP)
    goal = np.add(HELD.pose, (0.1, 0.0, 0.5))
    poses = np.array(HELD.pose), np.add(HELD.pose, (0.2, 0.1, 4.0)), goal
    path = PathTree(rolling, goal, []).path_to(Node(rolling, poses))
    assert np.abs(np.diff(path[:, 2])).max() < math.pi
    assert path[:, 2].max() == pytest.approx(poses[1][2])
    assert path[[0, -1]] == pytest.approx(np.array([HELD.pose, goal]))


def test_search_names_the_limits_of_the_robot_in_the_way():
    plan = plan_path(BENT, BENT_GRIP, BEYOND_LIMITS, max_steps=1)
    assert len(plan) == 0
    assert 'in the way: ' in plan.why
    assert 'module east/Y and member east/Q-R' in plan.why


@pytest.mark.nightly
def test_clearance_on_a_path_along_an_obstacle_is_foreseen_as_the_loop_keeps_it():
    """The loop keeps 21 mm, its bound and its safety margin, while it slides by over 0.3 m."""
    post = Obstacle('post', ConvexObject.disc((0.7382, 0.5276), 0.1113))
    poses = [
        HELD.pose,
        (0.5126, 0.8194, 0.4188),
        (0.3603, 0.6582, 0.8437),
        (0.3071, 0.5241, 0.802),
    ]
    foresight = foresee_path(HELD, 0.8, np.array(poses), obstacles=[post])
    assert foresight.why == ''
    assert min(clearance(grip, [post]) for grip in foresight.grips) > 0.0209


def test_goal_within_an_obstacle_is_refused_with_its_name():
    plan = plan_path(ROBOT, GRIP, POST.body.pose, [POST])
    assert len(plan) == plan.steps == 0
    assert plan.why.endswith('in the way: the object at the goal and obstacle post')


def test_start_in_contact_with_an_obstacle_is_refused_with_part_and_obstacle():
    touching = Obstacle('post', ConvexObject.disc((HELD.pose.x + 0.28, HELD.pose.y - 0.23), 0.08))
    plan = plan_path(ROBOT, GRIP, BEHIND, [touching])
    assert 'at the start, member north/Z-R and obstacle post' in plan.why


def test_search_ends_when_it_is_told_to():
    progress = []
    plan = plan_path(
        ROBOT, GRIP, BEYOND, POSTS, on_progress=progress.append, should_stop=lambda: True
    )
    assert '(stopped)' in plan.why
    assert len(progress) == 1


def test_search_is_bounded_and_names_the_obstacles_in_the_way():
    plan = plan_path(ROBOT, GRIP, BEYOND, POSTS, max_steps=50)
    assert plan.poses.shape == (0, 3)
    assert 50 <= plan.steps < 750
    assert 'obstacle post' in plan.why


def test_plan_for_an_object_that_is_not_held_has_the_reason():
    away = GRIP.moved_to(np.add(HELD.pose, (0.0, -0.2, 0.0)))
    plan = plan_path(ROBOT, away, BEHIND)
    assert plan.why.startswith('the object is not held: ')


def test_goal_in_degrees_is_refused():
    with pytest.raises(GraspError, match='degrees'):
        plan_path(ROBOT, GRIP, (0.7, 0.5, 90.0))


BOUND = 0.02
FREE = ConvexObject.disc((0.716, 0.5), 0.3)
MEMBERS = members_at(ROBOT, 'north/Z')
NEEDS = {'members': MEMBERS, 'squeeze': 8.0, 'count': 1}


def least_clearance(path, obstacles):
    """Return the least distance of the robot's parts from obstacles along a path [m]."""
    model, least = collision_model(ROBOT), np.inf
    for rollers in path:
        starts, ends = model.part_ends(ROBOT.configuration(rollers))
        for obstacle in obstacles:
            gaps = segment_gaps(obstacle.body, starts, ends).gaps - model.part_radii
            least = min(least, gaps.min())
    return least


@pytest.fixture(scope='module')
def unobstructed():
    """Return a grasp without obstacles, and where the members are at its end."""
    (grasp,) = plan_grasps(HOME, FREE, GraspRequirements(**NEEDS), max_rounds=1, thorough=False)
    return grasp


def beside(grasp, gap):
    """Return a post at a gap from a grasping member at the end of a path, outside of the loop."""
    start, end = member_ends(ROBOT.configuration(grasp.path[-1]), grasp.members[0])
    away = 0.5 * ROBOT.description.tube_diameter + gap + 0.05
    place = 0.5 * (start + end) + away * toward(FREE.center, start, end)
    return Obstacle('post', ConvexObject.disc((place.real, place.imag), 0.1))


@pytest.mark.parametrize('gap', [0.021, 0.05])
def test_path_to_a_grasp_keeps_its_clearance_from_obstacles(unobstructed, gap):
    post = beside(unobstructed, gap)
    needs = GraspRequirements(**NEEDS, obstacles=(post,))
    plan = plan_grasps(HOME, FREE, needs, max_rounds=2, thorough=False)
    for grasp in plan:
        assert least_clearance(grasp.path, [post]) >= BOUND - 1e-9
    assert len(plan) or plan.closest_violation.requirement == 'obstacle_clearance'


def test_plan_without_a_grasp_names_part_and_obstacle():
    x = HOME.points[ROBOT.topology.joint_names.index('Z')].real + 0.3
    post = Obstacle('post', ConvexObject.disc((x, 0.6), 0.2))
    needs = GraspRequirements(**NEEDS, obstacles=(post,))
    plan = plan_grasps(HOME, FREE, needs, max_rounds=1, thorough=False)
    assert not len(plan)
    assert plan.closest_violation.requirement == 'obstacle_clearance'
    assert 'and obstacle post are' in str(plan.closest_violation)


def test_release_keeps_its_clearance_from_obstacles(unobstructed):
    grasp = unobstructed
    config = ROBOT.configuration(grasp.path[-1])
    post = beside(grasp, 0.3)
    release = plan_release(config, grasp.grip.body, MEMBERS, 0.05, obstacles=(post,))
    assert release.violation is None
    assert least_clearance(release.path, [post]) >= BOUND
    near = beside(grasp, 0.03)
    refused = plan_release(config, grasp.grip.body, MEMBERS, 0.05, obstacles=(near,))
    assert refused.violation.requirement in ('obstacle_clearance', 'reach')
