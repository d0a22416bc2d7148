# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The exported model as hardware: actuators and sensors by the names of rollers and joints."""

from isotruss_ros.cli import export_mujoco
from isotruss_ros.core import load_robot, tangent_center
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
