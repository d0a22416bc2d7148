# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Objects of any shape in MuJoCo: where their surface is, how they press, and files with them."""

from isotruss_ros.cli.export_mujoco import main
from isotruss_ros.core import analyze_grasp, ConvexObject, Disc, Ellipse, load_robot, Polygon
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.mujoco_plant.object_geoms import MIN_CORNER_RADIUS, object_geoms
from isotruss_ros.mujoco_plant.plant import MujocoPlant
from mujoco_worlds import needs_mujoco
from nightly import some_now
import numpy as np
import pytest
from studies.comparison.grips import FINE, press_on, round_robot
from studies.comparison.wedge import closed_to, MODULE, pressed_into

BOX = ((-0.12, -0.09), (0.12, -0.09), (0.12, 0.09), (-0.12, 0.09))
SHAPES = {
    'disc': Disc(0.3),
    'ellipse': Ellipse((0.16, 0.1)),
    'box': Polygon(BOX),
    'rounded box': Polygon(BOX, (0.0, 0.01, 0.03, 0.05)),
}


@needs_mujoco
@pytest.mark.parametrize('shape', SHAPES.values(), ids=SHAPES)
def test_the_surface_is_that_of_the_object(shape):
    """A ray from far away to the inside hits it where the object begins."""
    import mujoco

    held = ConvexObject(shape, (3.0, 4.0, 0.7))
    plant = MujocoPlant(load_robot('triangle'), held)
    geom = np.zeros(1, dtype=np.int32)
    for angle in np.linspace(0.0, 6.0, 25):
        away = complex(np.exp(1j * angle))
        start = held.middle + away
        towards = np.array([-away.real, -away.imag, 0.0])
        origin = np.array([start.real, start.imag, 0.0])
        way = mujoco.mj_ray(plant.model, plant.data, origin, towards, None, 1, -1, geom)
        (gap,) = held.nearest(np.array([start - way * away])).gaps
        assert abs(gap) < 0.5 * MIN_CORNER_RADIUS


@needs_mujoco
@pytest.mark.parametrize('name', some_now(['rounded box', 'ellipse']))
def test_contact_forces_agree_with_statics(name):
    config = closed_to(round_robot().home, 40.0, 0.3)
    held = pressed_into(config, MODULE, SHAPES[name], 0.5, 0.01)
    plant = press_on(config, held, members_at(config.robot, MODULE), segments=FINE)
    np.testing.assert_allclose(plant.object_pose(), held.pose, atol=1e-4)
    forces, analysis = plant.contact_forces(), analyze_grasp(config, held)
    assert forces.keys() == analysis.contact_forces.keys()
    for member, force in forces.items():
        assert force.normal == pytest.approx(analysis.contact_forces[member], rel=0.05)
        assert abs(force.friction) < 1e-3 * force.normal


@needs_mujoco
def test_mass_and_friction_are_those_of_the_object():
    held = ConvexObject(SHAPES['box'], (3.0, 4.0, 0.7), mass=2.0, friction=0.3)
    plant = MujocoPlant(load_robot('triangle'), held)
    body = plant.model.body('object0')
    assert body.mass[0] == pytest.approx(2.0)
    assert body.inertia[2] == pytest.approx(2.0 * (0.24**2 + 0.18**2) / 12.0)
    assert plant.model.geom('object0#0').friction[0] == pytest.approx(0.3)


@needs_mujoco
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
    class Other(Disc):
        """Shape that MuJoCo does not know."""

    with pytest.raises(GraspError, match=r'Other.*: must be one of Disc, .* in MuJoCo'):
        object_geoms(ConvexObject(Other(0.3)))
