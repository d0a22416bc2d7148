# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""MuJoCo plant of the node `simulator`: its parameters and construction."""

from __future__ import annotations

from isotruss_ros.core import ConvexObject, Robot, RollerFaults
from isotruss_ros.mujoco_plant.driven_robot import DrivenRobot
from isotruss_ros.mujoco_plant.options import PlantOptions
from isotruss_ros.nodes.framework.parameters import FixedSpec, Parameters

#: Longest simulated time per cycle in wall time [s]; the remainder is reported as lag.
MAX_CYCLE_STEP = 0.1

MUJOCO_SPECS = (
    FixedSpec('object_mass', 0.5, 'Mass of the object, mujoco only [kg]', (0.01, 1e3)),
    FixedSpec(
        'ground_friction',
        0.0,
        'Friction force of the object on the ground along x or y, mujoco only [N]',
        (0.0, 1e3),
    ),
    FixedSpec(
        'recording',
        '',
        'File of the states of MuJoCo for later rendering; none if empty',
    ),
)


def make_driven_robot(
    robot: Robot,
    body: ConvexObject,
    values: Parameters,
    faults: RollerFaults,
    sim_time: bool,
) -> DrivenRobot:
    """
    Return a robot with its object in MuJoCo at home.

    :param robot: the robot.
    :param body: the object at its pose; its own mass has precedence over `object_mass`.
    :param values: parameters of the node.
    :param faults: faults of the rollers.
    :param sim_time: whether time is simulated; then there is no lag.
    :raises IsotrussError: MuJoCo is not installed, or a value is invalid.
    """
    options = PlantOptions(
        friction=values.friction,
        object_mass=values.object_mass,
        ground_friction=values.ground_friction,
    )
    longest = float('inf') if sim_time else MAX_CYCLE_STEP
    free, seed = values.object_is_free, values.seed
    return DrivenRobot(robot, body, free, options, faults, seed, longest)
