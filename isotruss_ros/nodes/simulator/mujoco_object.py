# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the parameters of `simulator` are to a robot in MuJoCo, and what it reports."""

from __future__ import annotations

from isotruss_ros.core import ConvexObject, Robot, RollerFaults
from isotruss_ros.mujoco_plant.driven_robot import DrivenRobot
from isotruss_ros.mujoco_plant.options import PlantOptions
from isotruss_ros.nodes.framework.parameters import FixedSpec, Parameters

#: More than this is not simulated at once where time is the wall's, but reported as lag [s].
LONGEST_STEP = 0.1

MUJOCO_SPECS = (
    FixedSpec('object_mass', 0.5, 'Mass of the object, mujoco only [kg]', (0.01, 1e3)),
    FixedSpec('module_mass', 1.0, 'Mass of a roller module, mujoco only [kg]', (0.01, 1e3)),
    FixedSpec(
        'ground_friction',
        0.0,
        'Force along x or y at which the object begins to slide on the ground, mujoco only [N]',
        (0.0, 1e3),
    ),
    FixedSpec(
        'recording',
        '',
        'File to which the states of MuJoCo are written, to be drawn later; none if empty',
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
    Return a robot in MuJoCo, at home, with its object.

    :param robot: whose home is where it begins.
    :param body: in its place; a mass of its own counts instead of `object_mass`.
    :param values: of the node.
    :param faults: how the rollers differ from perfect ones.
    :param sim_time: time is simulated, so that nothing can lag behind it.
    :raises IsotrussError: MuJoCo is not installed, or a value is not usable.
    """
    options = PlantOptions(
        friction=values.friction,
        object_mass=values.object_mass,
        module_mass=values.module_mass,
        ground_friction=values.ground_friction,
    )
    longest = float('inf') if sim_time else LONGEST_STEP
    free, seed = values.object_is_free, values.seed
    return DrivenRobot(robot, body, free, options, faults, seed, longest)
