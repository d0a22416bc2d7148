# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Actuators, sensors and friction of the floor in the exported model, and rollers that lag."""

from isotruss_ros.cli import export_mujoco
from isotruss_ros.core import load_robot, tangent_center
from isotruss_ros.mujoco_plant.options import PlantOptions
from isotruss_ros.mujoco_plant.plant import MujocoPlant
from mujoco_worlds import needs_mujoco
import numpy as np
import pytest

pytestmark = needs_mujoco

ROBOT = load_robot('nine_member')
NAMES, JOINTS = ROBOT.roller_names, ROBOT.topology.joint_names


def load(tmp_path, *arguments):
    """Return MuJoCo, and the model that the command writes."""
    mujoco = pytest.importorskip('mujoco')
    path = tmp_path / 'robot.xml'
    assert export_mujoco.main(['nine_member', str(path), *arguments]) == 0
    return mujoco, mujoco.MjModel.from_xml_path(str(path))


def run(mujoco, model, data, duration):
    """Let time pass."""
    for _ in range(round(duration / model.opt.timestep)):
        mujoco.mj_step(model, data)


def test_driven_rollers_move_the_joints_according_to_the_kinematics(tmp_path):
    mujoco, model = load(tmp_path)
    data, speeds = mujoco.MjData(model), 0.02 * np.array([1.0, -0.5, 0.8, 0.3, -1.0, 0.6])
    for command in (speeds, 0.0 * speeds):
        for name, speed in zip(NAMES, command, strict=True):
            data.actuator(name).ctrl = speed
        run(mujoco, model, data, 1.0)
    travel = [float(data.sensor(name).data[0]) for name in NAMES]
    assert travel == pytest.approx(speeds, abs=1e-5)
    nodes = ROBOT.configuration(speeds).nodes
    for number, joint in enumerate(JOINTS):
        assert data.sensor(joint).data[:2] == pytest.approx(nodes[number], abs=2e-4)


def test_sensors_measure_speeds_and_objects(tmp_path):
    x, y = tangent_center(ROBOT.home, 'north/Z', 0.3)
    mujoco, model = load(tmp_path, '--object', str(x), str(y), '0.3')
    assert model.body('object0').pos[:2] == pytest.approx((x, y))
    data = mujoco.MjData(model)
    for name in NAMES:
        data.actuator(name).ctrl = 0.01
    run(mujoco, model, data, 0.3)
    for name in NAMES:
        assert data.sensor(f'{name}:velocity').data[0] == pytest.approx(0.01, abs=1e-3)
    mujoco.mj_forward(model, data)
    measured = [*data.sensor('object0').data, *data.sensor('object0:orientation').data]
    body = data.body('object0')
    assert measured == pytest.approx([*body.xpos, *body.xquat])


TRIANGLE = load_robot('triangle')
STILL = np.zeros(len(TRIANGLE.roller_names))


def pulled(friction, force):
    """Return by how much a pull moves the top of the triangle [m]."""
    plant = MujocoPlant(TRIANGLE, options=PlantOptions(module_friction=friction))
    start = plant.nodes[TRIANGLE.node_names.index('T')].copy()
    plant.load_joint('T', (force, 0.0))
    plant.settle(3.0)
    return np.hypot(*(plant.nodes[TRIANGLE.node_names.index('T')] - start))


def test_the_floor_takes_its_friction_off_a_pull():
    assert pulled(2.0, 1.8) < 1e-4
    assert 1e-3 < pulled(0.0, 4.0) < pulled(2.0, 6.0) < 0.9 * pulled(0.0, 6.0)


def test_a_roller_follows_its_command_with_its_lag():
    plant = MujocoPlant(TRIANGLE, options=PlantOptions(roller_lag=0.1))
    command = np.zeros_like(STILL)
    command[0] = 0.02
    plant.advance(0.1, command)
    assert plant.speeds[0] == pytest.approx(0.02 * (1.0 - np.exp(-1.0)), rel=1e-6)
    assert plant.travel[0] == pytest.approx(0.02 * 0.1 * np.exp(-1.0), rel=0.03)


def test_a_roller_stops_if_the_tube_requires_more_than_its_force():
    command = np.zeros_like(STILL)
    command[0] = 0.02
    weak = MujocoPlant(TRIANGLE, options=PlantOptions(roller_force=3.0))
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
