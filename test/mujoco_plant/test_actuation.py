# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The exported model as hardware: actuators and sensors by the names of rollers and joints."""

from isotruss_ros.cli import export_mujoco
from isotruss_ros.core import load_robot, tangent_center
from mujoco_worlds import needs_mujoco
import pytest

pytestmark = needs_mujoco

ROBOT = load_robot('nine_member')
NAMES, JOINTS = ROBOT.roller_names, ROBOT.topology.joint_names
SPEED, TIME = 0.02, 1.0


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


@pytest.mark.parametrize('roller', NAMES[::2])
def test_a_driven_roller_moves_the_joints_as_the_kinematics_have_it(roller, tmp_path):
    mujoco, model = load(tmp_path)
    data = mujoco.MjData(model)
    data.actuator(roller).ctrl = SPEED
    run(mujoco, model, data, TIME)
    data.actuator(roller).ctrl = 0.0
    run(mujoco, model, data, TIME)
    travel = [float(data.sensor(name).data[0]) for name in NAMES]
    expected = [SPEED * TIME * (name == roller) for name in NAMES]
    assert travel == pytest.approx(expected, abs=1e-5)
    nodes = ROBOT.configuration(expected).nodes
    for number, joint in enumerate(JOINTS):
        assert data.sensor(joint).data[:2] == pytest.approx(nodes[number], abs=2e-4)


def test_sensors_measure_speeds_and_objects(tmp_path):
    x, y = tangent_center(ROBOT.home, 'north/Z', 0.3)
    mujoco, model = load(tmp_path, '--object', str(x), str(y), '0.3')
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
