# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Grasps and releases among obstacles: no configuration of their paths touches one."""

from isotruss_ros.core import ConvexObject, GraspRequirements, Obstacle, plan_grasps
from isotruss_ros.core.kinematics.distances import collision_model
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.model.convex_object import segment_gaps
from isotruss_ros.core.planning.release import plan_release
import numpy as np
import pytest
from robots import preset

HOME, BOUND = preset('nine_member').home, 0.02
BODY = ConvexObject.disc((0.716, 0.5), 0.3)
MEMBERS = members_at(HOME.robot, 'north/Z')
NEEDS = {'members': MEMBERS, 'squeeze': 8.0, 'count': 1}


def least_clearance(path, obstacles):
    """Return the least distance of the robot's parts from obstacles along a path [m]."""
    model, least = collision_model(HOME.robot), np.inf
    for rollers in path:
        starts, ends = model.part_ends(HOME.robot.configuration(rollers))
        for obstacle in obstacles:
            gaps = segment_gaps(obstacle.body, starts, ends).gaps - model.part_radii
            least = min(least, gaps.min())
    return least


@pytest.fixture(scope='module')
def unobstructed():
    """Return a grasp without obstacles, and where the members are at its end."""
    (grasp,) = plan_grasps(HOME, BODY, GraspRequirements(**NEEDS), max_rounds=1, thorough=False)
    return grasp


def beside(grasp, gap):
    """Return a post at a gap from a grasping member at the end of a path, outside of the loop."""
    config = HOME.robot.configuration(grasp.path[-1])
    model = collision_model(HOME.robot)
    member = HOME.robot.member_names.index(grasp.members[0])
    starts, ends = model.part_ends(config)
    middle = 0.5 * (starts[member] + ends[member])
    normal = 1j * (ends[member] - starts[member]) / abs(ends[member] - starts[member])
    if (normal.conjugate() * (middle - BODY.center)).real < 0.0:
        normal = -normal
    place = middle + (0.5 * HOME.robot.description.tube_diameter + gap + 0.05) * normal
    return Obstacle('post', ConvexObject.disc((place.real, place.imag), 0.1))


@pytest.mark.parametrize('gap', [0.021, 0.05])
def test_path_to_a_grasp_keeps_its_clearance_from_obstacles(unobstructed, gap):
    post = beside(unobstructed, gap)
    needs = GraspRequirements(**NEEDS, obstacles=(post,))
    plan = plan_grasps(HOME, BODY, needs, max_rounds=2, thorough=False)
    for grasp in plan:
        assert least_clearance(grasp.path, [post]) >= BOUND - 1e-9
    assert len(plan) or plan.closest_violation.requirement == 'obstacle_clearance'


def test_plan_without_a_grasp_names_part_and_obstacle():
    x, y = HOME.points[HOME.robot.topology.joint_names.index('Z')].real, 0.6
    config_gap = 0.3
    post = Obstacle('post', ConvexObject.disc((x + config_gap, y), 0.2))
    needs = GraspRequirements(**NEEDS, obstacles=(post,))
    plan = plan_grasps(HOME, BODY, needs, max_rounds=1, thorough=False)
    assert not len(plan)
    assert plan.closest_violation.requirement == 'obstacle_clearance'
    assert 'and obstacle post are' in str(plan.closest_violation)


def test_release_keeps_its_clearance_from_obstacles(unobstructed):
    grasp = unobstructed
    config = HOME.robot.configuration(grasp.path[-1])
    post = beside(grasp, 0.3)
    release = plan_release(config, grasp.grip.body, MEMBERS, 0.05, obstacles=(post,))
    assert release.violation is None
    assert least_clearance(release.path, [post]) >= BOUND
    near = beside(grasp, 0.03)
    refused = plan_release(config, grasp.grip.body, MEMBERS, 0.05, obstacles=(near,))
    assert refused.violation.requirement in ('obstacle_clearance', 'reach')
