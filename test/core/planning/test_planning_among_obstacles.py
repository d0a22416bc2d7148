# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Paths of held objects, grasps and releases among obstacles, and what is in their way."""

from isotruss_ros.core import (
    ConvexObject,
    GraspRequirements,
    Grip,
    load_robot,
    Obstacle,
    plan_grasps,
    plan_path,
    settle_grasp,
    tangent_center,
)
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.distances import collision_model
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.model.convex_object import segment_gaps
from isotruss_ros.core.planning.foresee_path import foresee_path
from isotruss_ros.core.planning.release import plan_release
import numpy as np
import pytest
from random_grips import toward
from robots import member_ends
from studies.comparison.rooms import clearance

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


HOME, BOUND = ROBOT.home, 0.02
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
