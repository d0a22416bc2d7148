# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Objects, actuators, sensors and friction of the floor in the exported model."""

from isotruss_ros import core
from isotruss_ros.cli import export_mujoco
from isotruss_ros.cli.export_mujoco import main
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.mujoco_plant.object_geoms import MIN_CORNER_RADIUS, object_geoms
from isotruss_ros.mujoco_plant.options import PlantOptions
from isotruss_ros.mujoco_plant.plant import MujocoPlant
from mujoco_worlds import needs_mujoco
from nightly import some_now
import numpy as np
from pressed_plants import FINE, press_on, round_robot
import pytest
from wedge import closed_to, MODULE, pressed_into

pytestmark = needs_mujoco
BOX = ((-0.12, -0.09), (0.12, -0.09), (0.12, 0.09), (-0.12, 0.09))
SHAPES = {
    'disc': core.Disc(0.3),
    'ellipse': core.Ellipse((0.16, 0.1)),
    'box': core.Polygon(BOX),
    'rounded box': core.Polygon(BOX, (0.0, 0.01, 0.03, 0.05)),
}
ROBOT = core.load_robot('nine_member')
NAMES, JOINTS = ROBOT.roller_names, ROBOT.topology.joint_names
TRIANGLE = core.load_robot('triangle')
STILL = np.zeros(len(TRIANGLE.roller_names))


@pytest.mark.parametrize('shape', SHAPES.values(), ids=SHAPES)
def test_the_surface_is_that_of_the_object(shape):
    """A ray from far away to the inside hits it where the object begins."""
    import mujoco

    held = core.ConvexObject(shape, (3.0, 4.0, 0.7))
    plant = MujocoPlant(core.load_robot('triangle'), held)
    geom = np.zeros(1, dtype=np.int32)
    for angle in np.linspace(0.0, 6.0, 25):
        away = complex(np.exp(1j * angle))
        start = held.middle + away
        towards = np.array([-away.real, -away.imag, 0.0])
        origin = np.array([start.real, start.imag, 0.0])
        way = mujoco.mj_ray(plant.model, plant.data, origin, towards, None, 1, -1, geom)
        (gap,) = held.nearest(np.array([start - way * away])).gaps
        assert abs(gap) < 0.5 * MIN_CORNER_RADIUS


@pytest.mark.parametrize('name', some_now(['rounded box', 'ellipse']))
def test_contact_forces_agree_with_statics(name):
    config = closed_to(round_robot().home, 40.0, 0.3)
    held = pressed_into(config, MODULE, SHAPES[name], 0.5, 0.01)
    plant = press_on(config, held, members_at(config.robot, MODULE), segments=FINE)
    np.testing.assert_allclose(plant.object_pose(), held.pose, atol=1e-4)
    forces, analysis = plant.contact_forces(), core.analyze_grasp(config, held)
    assert forces.keys() == analysis.contact_forces.keys()
    for member, force in forces.items():
        assert force.normal == pytest.approx(analysis.contact_forces[member], rel=0.05)
        assert abs(force.friction) < 1e-3 * force.normal


def test_mass_and_friction_are_those_of_the_object():
    held = core.ConvexObject(SHAPES['box'], (3.0, 4.0, 0.7), mass=2.0, friction=0.3)
    plant = MujocoPlant(core.load_robot('triangle'), held)
    body = plant.model.body('object0')
    assert body.mass[0] == pytest.approx(2.0)
    assert body.inertia[2] == pytest.approx(2.0 * (0.24**2 + 0.18**2) / 12.0)
    assert plant.model.geom('object0#0').friction[0] == pytest.approx(0.3)


def test_objects_of_files_are_exported(tmp_path, capsys):
    import mujoco

    file, model = tmp_path / 'box.yaml', tmp_path / 'model.xml'
    file.write_text(f'shape: polygon\nvertices: {[list(corner) for corner in BOX]}\n')
    shape = ['--shape', str(file)]
    assert main(['triangle', str(model), *shape, '3', '4', '0.7', '--friction', '0.4']) == 0
    exported = mujoco.MjModel.from_xml_path(str(model))
    assert exported.body('object0').pos[:2].tolist() == [3.0, 4.0]
    assert exported.geom('object0#0').friction[0] == pytest.approx(0.4)
    data = mujoco.MjData(exported)
    mujoco.mj_forward(exported, data)
    along_x, along_y = data.geom('object0#0').xmat.reshape(3, 3)[:2, 2]
    assert along_y / along_x == pytest.approx(np.tan(0.7))
    for robot, angle, words in (('triangle', 'left', 'left'), ('nobody', '0.7', 'nobody')):
        assert main([robot, str(model), *shape, '3', '4', angle]) == 2
        assert words in capsys.readouterr().err


def test_shape_without_geoms_is_refused_by_name():
    class Other(core.Disc):
        """Shape that MuJoCo does not know."""

    with pytest.raises(GraspError, match=r'Other.*: must be one of Disc, .* in MuJoCo'):
        object_geoms(core.ConvexObject(Other(0.3)))


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
    x, y = core.tangent_center(ROBOT.home, 'north/Z', 0.3)
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
