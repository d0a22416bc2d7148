# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Friction of the floor, and rollers that lag and are not of any strength, in MuJoCo."""

from isotruss_ros.core import load_robot
from isotruss_ros.mujoco_plant.options import PlantOptions
from isotruss_ros.mujoco_plant.plant import MujocoPlant
from mujoco_worlds import needs_mujoco
import numpy as np
import pytest

pytestmark = needs_mujoco

ROBOT = load_robot('triangle')
STILL = np.zeros(len(ROBOT.roller_names))


def pulled(friction, force):
    """Return by how much a pull moves the top of the triangle [m]."""
    plant = MujocoPlant(ROBOT, options=PlantOptions(module_friction=friction))
    start = plant.nodes[ROBOT.node_names.index('T')].copy()
    plant.load_joint('T', (force, 0.0))
    plant.settle(3.0)
    return np.hypot(*(plant.nodes[ROBOT.node_names.index('T')] - start))


def test_the_floor_takes_its_friction_off_a_pull():
    assert pulled(2.0, 1.8) < 1e-4
    assert 1e-3 < pulled(0.0, 4.0) < pulled(2.0, 6.0) < 0.9 * pulled(0.0, 6.0)


def test_a_roller_follows_its_command_with_its_lag():
    plant = MujocoPlant(ROBOT, options=PlantOptions(roller_lag=0.1))
    command = np.zeros_like(STILL)
    command[0] = 0.02
    plant.advance(0.1, command)
    assert plant.speeds[0] == pytest.approx(0.02 * (1.0 - np.exp(-1.0)), rel=1e-6)
    assert plant.travel[0] == pytest.approx(0.02 * 0.1 * np.exp(-1.0), rel=0.03)


def test_a_roller_stops_if_the_tube_requires_more_than_its_force():
    command = np.zeros_like(STILL)
    command[0] = 0.02
    weak = MujocoPlant(ROBOT, options=PlantOptions(roller_force=3.0))
    weak.load_joint('T', (0.0, -40.0))
    weak.settle(1.0)
    before = weak.travel.copy()
    moved = []
    for sign in (1.0, -1.0):
        weak.advance(0.1, sign * command)
        moved.append(abs(weak.travel[0] - before[0]))
        before = weak.travel.copy()
    # It can go where the tubes push it, and not against them.
    assert min(moved) < 1e-4
    assert max(moved) > 1e-3
