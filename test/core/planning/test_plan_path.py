# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Paths around obstacles: accepted by `foresee_path`, and refusals with what is in the way."""

from isotruss_ros.core import (
    ConvexObject,
    Grip,
    load_robot,
    Obstacle,
    plan_path,
    settle_grasp,
    tangent_center,
)
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.planning.foresee_path import foresee_path
import numpy as np
import pytest
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
    straight = foresee_path(HELD, 0.8, np.array([HELD.pose, BEHIND]), obstacles=[POST])
    assert straight.why.startswith('out of reach: limits of ')
    assert 'obstacle post' in straight.why

    plan = plan_path(ROBOT.home, GRIP, BEHIND, [POST])
    assert plan.poses[0] == pytest.approx(np.array(HELD.pose))
    assert plan.poses[-1] == pytest.approx(BEHIND)
    foresight = foresee_path(HELD, 0.8, plan.poses, obstacles=[POST])
    assert foresight.why == ''
    assert min(clearance(grip, [POST]) for grip in foresight.grips) > 0.0199


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
    plan = plan_path(ROBOT, GRIP, BEYOND, POSTS, max_steps=400)
    assert plan.poses.shape == (0, 3)
    assert 400 <= plan.steps < 3000
    assert 'obstacle post' in plan.why


def test_plan_for_an_object_that_is_not_held_has_the_reason():
    away = GRIP.moved_to(np.add(HELD.pose, (0.0, -0.2, 0.0)))
    plan = plan_path(ROBOT, away, BEHIND)
    assert plan.why.startswith('the object is not held: ')


def test_goal_in_degrees_is_refused():
    with pytest.raises(GraspError, match='degrees'):
        plan_path(ROBOT, GRIP, (0.7, 0.5, 90.0))
