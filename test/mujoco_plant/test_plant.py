# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Motion, forces and friction in MuJoCo against kinematics and statics."""

from dataclasses import replace
import importlib

from isotruss_ros.core import analyze_grasp, deform, load_robot, Robot, settle_grasp
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.mujoco_plant.options import load_mujoco, PlantError, PlantOptions
from isotruss_ros.mujoco_plant.plant import MujocoPlant
from mujoco_worlds import needs_mujoco
import numpy as np
import pytest
from studies.comparison.grips import move_to, press, PressedCase, release, STILL


@needs_mujoco
def test_weight_of_the_modules_follows_their_mass():
    file = load_robot('triangle').description

    def sag(mass):
        robot = Robot(replace(file, module=replace(file.module, mass=mass)))
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
    robot = load_robot('nine_member')
    plant = MujocoPlant(robot, options=STILL)
    move_to(plant, [0.1, -0.05, 0.08, 0.02, -0.06, 0.04])
    plant.settle(4.0)
    config = robot.configuration(plant.travel)
    before = plant.nodes
    np.testing.assert_allclose(before, config.nodes, atol=1e-6)
    plant.load_joint('Z', (0.05, 0.03))
    plant.settle(4.0)
    expected = deform(config, {'Z': (0.05, 0.03)})
    moved = np.array([expected.displacement(node)[:2] for node in robot.node_names])
    np.testing.assert_allclose(plant.nodes - before, moved, atol=2e-3 * np.abs(moved).max())


@needs_mujoco
def test_forces_friction_and_compliance_of_a_grasp_agree_with_statics():
    plant, config, cylinder = press(PressedCase(40.0, 0.04))
    result = plant.contact_forces()
    expected = analyze_grasp(config, cylinder, 0.5).contact_forces
    assert result.keys() == expected.keys()
    for member, force in result.items():
        # Capsules bend in steps, and the object touches the middle of one.
        assert force.normal == pytest.approx(expected[member], rel=0.05)
        assert force.friction == pytest.approx(0.0, abs=0.01)
    release(plant, 0.8)
    start = np.array(plant.object_pose())
    forces = plant.contact_forces()
    settled = settle_grasp(config, cylinder.moved_to(start), 0.8)
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
        MujocoPlant(load_robot('triangle'))


@pytest.mark.parametrize(
    'values',
    [
        {'object_mass': 0.0},
        {'friction': -0.1},
        {'segments': 0},
        {'time_step': np.nan},
        {'module_friction': -1.0},
        {'roller_lag': np.nan},
        {'roller_force': 0.0},
        {'gravity': (0.0, np.inf)},
    ],
)
def test_unusable_options_are_refused(values):
    with pytest.raises(PlantError, match='MuJoCo plant'):
        PlantOptions(**values)
