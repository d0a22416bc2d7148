# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Planned grasps that are corrected until MuJoCo measures what was planned."""

from dataclasses import replace

from comparison.grips import mesh, round_robot, STILL
from isotruss_ros.core import ConvexObject, GraspRequirements, plan_grasps
from isotruss_ros.mujoco_plant.plant import MujocoPlant
from isotruss_ros.mujoco_plant.refine_grasp import refine_grasp
from mujoco_worlds import needs_mujoco
import numpy as np
import pytest

pytestmark = needs_mujoco

FRICTION = 0.7


def plan(number):
    """Return a random plan for a disc between two members."""
    rng, grasps = np.random.default_rng(number), ()
    while not grasps or len(grasps[0].grip.members) > 2:
        center, diameter = rng.uniform((0.45, 0.25), (0.75, 0.45)), rng.uniform(0.18, 0.32)
        squeeze = rng.uniform(12.0, 28.0)
        needs = GraspRequirements(friction=FRICTION, squeeze=squeeze, min_slip_margin=1.0, count=1)
        disc = ConvexObject.disc(center, diameter)
        grasps = plan_grasps(round_robot().home, disc, needs, thorough=False).grasps
    return grasps[0]


@pytest.mark.parametrize(
    'number', [0, *(pytest.param(n, marks=pytest.mark.nightly) for n in range(1, 20))]
)
def test_squeeze_and_slip_margin_become_those_that_were_planned(number):
    grasp = plan(number)
    robot, options = grasp.config.robot, replace(STILL, friction=FRICTION)
    # As fine as what presses on the object has to be.
    segments = mesh(robot, grasp.grip.members)
    plant = MujocoPlant(robot, grasp.grip.body, options, segments)
    refined = refine_grasp(grasp, plant)
    first, *_, last = refined.measured / (grasp.squeeze, grasp.slip_margin)
    assert refined.agrees
    assert np.abs(first - 1.0).max() > 0.02  # as planned it is not
    assert np.abs(last - 1.0).max() <= 0.02
    # What leads to the touch stays; from there on the rollers are those of the correction.
    path, before = refined.grasp.path, grasp.path
    assert np.array_equal(path[: grasp.touch + 1], before[: grasp.touch + 1])
    assert path[-1] == pytest.approx(refined.grasp.config.roller_positions)
