# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Closing on a free object: simulation of planned paths with elastic tubes."""

import functools
import itertools
import math

import closings
from isotruss_ros import core
from nightly import some_now
import pytest
from robots import preset

HOME = preset('nine_member').home
MODULE, FRICTION = 'north/Z', 0.5
BODY = core.ConvexObject.disc((0.6, 0.3), 0.3)


@functools.lru_cache(maxsize=8)
def planned(**values):
    """Return a planned grasp."""
    needs = core.GraspRequirements(friction=FRICTION, module=MODULE, count=1, **values)
    return core.plan_grasps(HOME, BODY, needs, thorough=False)[0]


@pytest.mark.parametrize(
    ('squeeze', 'parts'), some_now([(15.0, 5), (8.0, 20), (None, 20), (15.0, 40)])
)
def test_a_free_object_stays_at_its_pose_while_the_planned_grip_closes(squeeze, parts):
    grasp = planned(squeeze=squeeze)
    if squeeze is not None:
        assert grasp.squeeze == pytest.approx(squeeze, rel=2e-3)
    simulated, held = core.ElasticObject(BODY, FRICTION), []
    robot = core.SimulatedRobot(HOME, simulated, core.RollerFaults())
    for piece in itertools.pairwise(grasp.path):
        closings.drive(robot, piece, parts)
        held.append(simulated.grasp is not None)
    # Nothing presses before the touch, and all of it is held from there on.
    assert held == [False] * grasp.touch + [True] * (len(grasp.path) - 1 - grasp.touch)
    assert simulated.grasp.squeeze == pytest.approx(grasp.squeeze, rel=0.01)
    assert simulated.slip_margin == pytest.approx(grasp.slip_margin, rel=0.02)
    assert robot.object_pose[:2] == pytest.approx(BODY.pose[:2], abs=4e-4)
    assert abs(robot.object_pose.angle) < math.radians(0.2)


def test_a_robot_with_two_rollers_displaces_the_object_by_little():
    home, body = preset('triangle').home, core.ConvexObject.disc((0.716, 0.5), 0.4)
    needs = core.GraspRequirements(module='main/T', count=1)
    (grasp,) = core.plan_grasps(home, body, needs, thorough=False)
    away = abs(grasp.grip.center - body.center)
    assert 1e-4 < away < 0.25 * home.robot.description.tube_diameter
    config = preset('triangle').configuration(grasp.path[-1])
    settled = core.settle_grasp(config, grasp.grip.body, FRICTION)
    assert settled.held
    assert settled.slip_margin == pytest.approx(grasp.slip_margin, rel=1e-3)
