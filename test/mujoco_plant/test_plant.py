# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Motion, forces, friction and contacts with obstacles in MuJoCo."""

from dataclasses import replace
import importlib

from isotruss_ros import core
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.model.obstacle import HalfPlane
from isotruss_ros.mujoco_plant.options import load_mujoco, PlantError, PlantOptions
from isotruss_ros.mujoco_plant.plant import MujocoPlant
from mujoco_worlds import needs_mujoco
import numpy as np
import pytest
from robots import preset
from studies.comparison.grips import move_to, press, PressedCase, release, STILL


@needs_mujoco
def test_weight_of_the_modules_follows_their_mass():
    file = core.load_robot('triangle').description

    def sag(mass):
        robot = core.Robot(replace(file, module=replace(file.module, mass=mass)))
        plant = MujocoPlant(robot, options=replace(STILL, gravity=(0.0, -0.05)))
        plant.settle(4.0)
        return plant.nodes - robot.home.nodes

    light, middle, heavy = sag(1.0), sag(2.0), sag(3.0)
    assert np.abs(middle - light).max() > 1e-5
    assert (middle - light)[:, 1].sum() < 0.0
    # Each kilogram adds as much; what the tubes weigh is in all of them.
    np.testing.assert_allclose(heavy - middle, middle - light, atol=1e-2 * np.abs(middle).max())


@needs_mujoco
def test_nodes_agree_with_the_kinematics_and_under_a_small_joint_load_with_deform():
    robot = core.load_robot('nine_member')
    plant = MujocoPlant(robot, options=STILL)
    move_to(plant, [0.1, -0.05, 0.08, 0.02, -0.06, 0.04])
    plant.settle(4.0)
    config = robot.configuration(plant.travel)
    before = plant.nodes
    np.testing.assert_allclose(before, config.nodes, atol=1e-6)
    plant.load_joint('Z', (0.05, 0.03))
    plant.settle(4.0)
    expected = core.deform(config, {'Z': (0.05, 0.03)})
    moved = np.array([expected.displacement(node)[:2] for node in robot.node_names])
    np.testing.assert_allclose(plant.nodes - before, moved, atol=2e-3 * np.abs(moved).max())


@needs_mujoco
def test_forces_friction_and_compliance_of_a_grasp_agree_with_statics():
    plant, config, cylinder = press(PressedCase(40.0, 0.04))
    result = plant.contact_forces()
    expected = core.analyze_grasp(config, cylinder, 0.5).contact_forces
    assert result.keys() == expected.keys()
    for member, force in result.items():
        # Capsules bend in steps, and the object touches the middle of one.
        assert force.normal == pytest.approx(expected[member], rel=0.05)
        assert force.friction == pytest.approx(0.0, abs=0.01)
    release(plant, 0.8)
    start = np.array(plant.object_pose())
    forces = plant.contact_forces()
    settled = core.settle_grasp(config, cylinder.moved_to(start), 0.8)
    required = max(abs(force.friction) / force.normal for force in forces.values())
    assert required == pytest.approx(settled.required_friction, rel=0.03)
    for member, force in forces.items():
        assert force.friction == pytest.approx(settled.friction_forces[member], rel=0.2)
    plant.pull((1.0, 0.0, 0.0))
    plant.settle(3.0)
    gives = np.linalg.solve(settled.stiffness, [1.0, 0.0, 0.0])
    np.testing.assert_allclose(
        np.array(plant.object_pose()) - start, gives, atol=0.1 * np.abs(gives).max()
    )


@needs_mujoco
def test_a_carried_object_follows_and_is_lost_if_friction_is_too_low():
    plant, config, body = press(PressedCase(40.0, 0.04))
    release(plant, 0.8)
    start = np.array(plant.object_pose())
    held = attach_grip(config, body.moved_to(start))
    travel = plant.travel + np.array([0.01, -0.01, 0.01, 0.01, -0.005, 0.01])
    there = config.moved_to(travel)
    move_to(plant, travel)
    result, expected = np.array(plant.object_pose()), np.array(roll_grip(held, there).pose)
    way = np.linalg.norm(result[:2] - start[:2])
    assert way > 0.01
    assert np.linalg.norm((result - expected)[:2]) < max(1e-3, 0.05 * way)
    assert len(plant.contact_forces()) == 2
    needed = max(abs(f.friction) / f.normal for f in plant.contact_forces().values())
    plant.set_friction(1.05 * needed)
    plant.settle(2.0)
    assert len(plant.contact_forces()) == 2
    plant.set_friction(0.9 * needed)
    plant.settle(6.0)
    assert np.linalg.norm(np.array(plant.object_pose())[:2] - result[:2]) > 0.01


def test_without_mujoco_a_sentence_says_what_to_install(monkeypatch):
    def missing(name):
        raise ImportError(f'No module named {name!r}')

    load_mujoco.cache_clear()
    monkeypatch.setattr(importlib, 'import_module', missing)
    with pytest.raises(PlantError, match=r"pip install 'mujoco>=3.11,<4' in"):
        MujocoPlant(core.load_robot('triangle'))


UNUSABLE = {'object_mass': 0.0, 'friction': -0.1, 'segments': 0, 'time_step': np.nan}
UNUSABLE |= {'module_friction': -1.0, 'roller_lag': np.nan, 'roller_force': 0.0}
UNUSABLE |= {'gravity': (0.0, np.inf)}


@pytest.mark.parametrize('option', UNUSABLE)
def test_unusable_options_are_refused(option):
    with pytest.raises(PlantError, match='MuJoCo plant'):
        PlantOptions(**{option: UNUSABLE[option]})


ROBOT = preset('nine_member')
BODY = core.ConvexObject.disc((0.716, 0.45), 0.3)
SHAPES = [
    core.Disc(0.1),
    core.Ellipse((0.05, 0.1)),
    core.Polygon(((-0.05, -0.1), (0.05, -0.1), (0.05, 0.1), (-0.05, 0.1))),
]


@needs_mujoco
@pytest.mark.parametrize('shape', SHAPES, ids=lambda shape: type(shape).__name__)
@pytest.mark.parametrize('gap', [0.01, -0.002])
def test_contacts_with_an_obstacle_are_counted_by_its_name(shape, gap):
    reach = 0.15 + 0.05
    near = core.Obstacle('near', core.ConvexObject(shape, (0.716 + reach + gap, 0.45, 0.0)))
    far = core.Obstacle('far', core.ConvexObject(shape, (5.0, 5.0, 0.0)))
    plant = MujocoPlant(ROBOT, BODY, obstacles=[far, near])
    plant.advance(0.02, [0.0] * len(ROBOT.roller_names))
    touched = {name for name, count in plant.obstacle_contacts.items() if count}
    assert touched == (set() if gap > 0.0 else {'near'})


@needs_mujoco
def test_wall_stops_an_object_that_is_pulled_toward_it():
    """The robot is far away, at x < 2.3 m."""
    wall = core.Obstacle('wall', core.ConvexObject(HalfPlane(), (2.86, 0.0, np.pi)))
    plant = MujocoPlant(ROBOT, BODY.moved_to((2.7, 0.5, 0.0)), obstacles=[wall])
    plant.pull((5.0, 0.0, 0.0))
    plant.settle(1.0)
    assert plant.object_pose().x == pytest.approx(2.71, abs=2e-3)
    assert plant.obstacle_contacts['wall'] > 10


@needs_mujoco
def test_moved_obstacle_touches_the_object():
    post = core.Obstacle('post', core.ConvexObject.disc((3.0, 0.45), 0.1))
    plant = MujocoPlant(ROBOT, BODY, obstacles=[post])
    plant.settle(0.02)
    assert not plant.obstacle_contacts
    plant.move_obstacles([replace(post, body=post.body.moved_to((0.716 + 0.198, 0.45, 0.3)))])
    plant.settle(0.02)
    assert plant.obstacle_contacts['post']
    with pytest.raises(PlantError, match='obstacles: must be those of the plant, post'):
        plant.move_obstacles([])
