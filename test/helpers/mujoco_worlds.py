# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tests that need MuJoCo, or EGL for its pictures, are skipped where it is not installed."""

import importlib.util

from isotruss_ros.core import ConvexObject, load_robot
from isotruss_ros.mujoco_plant.options import PlantError
from isotruss_ros.mujoco_plant.plant import MujocoPlant
from isotruss_ros.mujoco_plant.recording import PlantRecorder
from isotruss_ros.mujoco_plant.rendering import require_egl
import pytest

#: What is recorded: a triangle with a disc in its middle.
ROBOT = load_robot('triangle')
CENTER, DIAMETER = ROBOT.home.points.mean(), 0.3
needs_mujoco = pytest.mark.skipif(
    importlib.util.find_spec('mujoco') is None,
    reason='MuJoCo is not installed: pip install mujoco (make venv does)',
)


def needs_egl(test):
    """Skip a test where there is nothing to draw with."""
    try:
        require_egl()
    except PlantError as error:
        return pytest.mark.skip(reason=str(error))(test)
    return test


def record(path, speeds=(0.05, 0.0), seconds=1.0):
    """Record a robot whose rollers turn; return the plant."""
    plant = MujocoPlant(ROBOT, ConvexObject.disc((CENTER.real, CENTER.imag), DIAMETER))
    recorder = PlantRecorder(plant, path, 25.0)
    for _ in range(round(100 * seconds)):
        recorder.record(plant.time)
        plant.advance(0.01, speeds)
    recorder.close()
    return plant
