"""Plants in MuJoCo; tests that need one are skipped where MuJoCo is not installed."""

import importlib.util

from grips import closed_to
from isotruss_ros.core import Cylinder, load_robot, tangent_center
from isotruss_ros.mujoco_plant.options import PlantOptions
from isotruss_ros.mujoco_plant.plant import MujocoPlant
import numpy as np
import pytest

needs_mujoco = pytest.mark.skipif(
    importlib.util.find_spec('mujoco') is None,
    reason='MuJoCo is not installed: pip install mujoco (make venv does)',
)


def move_to(plant, travel, duration=2.0, cycle=0.01):
    """Drive the rollers to a travel at even speeds, and let the robot come to rest."""
    speeds = (np.asarray(travel) - plant.travel) / duration
    for _ in range(round(duration / cycle)):
        plant.advance(cycle, speeds)
    plant.settle(1.0)


def gripped_plant(indentation, friction, degrees=40.0, diameter=0.3):
    """Return a plant that holds an object fast, pressed into the wedge, and its configuration."""
    robot = load_robot('nine_member')
    config = closed_to(robot.home, degrees, diameter)
    cylinder = Cylinder(tangent_center(config, 'north/Z', diameter, indentation), diameter)
    # From the side it would be in the way of the closing wedge.
    plant = MujocoPlant(robot, [cylinder], PlantOptions(friction=friction))
    plant.hold_object((5.0, 5.0, 0.0))
    move_to(plant, config.roller_positions)
    plant.hold_object((*cylinder.center, 0.0))
    plant.settle(1.0)
    return plant, config, cylinder
