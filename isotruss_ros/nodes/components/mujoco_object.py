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
        'gravity_x',
        0.0,
        'Gravity along x, mujoco only; not zero where the robot stands upright [m/s^2]',
        (-20.0, 20.0),
    ),
    FixedSpec(
        'gravity_y',
        0.0,
        'Gravity along y, mujoco only; not zero where the robot stands upright [m/s^2]',
        (-20.0, 20.0),
    ),
    FixedSpec(
        'ground_friction',
        0.0,
        'Force at which the object begins to slide on the ground, mujoco (along x or y) and, '
        'held, elastic [N]',
        (0.0, 1e3),
    ),
    FixedSpec(
        'module_friction',
        0.0,
        'Force at which a joint of the robot begins to slide on the floor, mujoco (along x or y) '
        'and, where it holds the object, elastic [N]',
        (0.0, 1e3),
    ),
    FixedSpec(
        'roller_lag',
        0.0,
        'Time constant of the rollers behind their commands, mujoco only [s]',
        (0.0, 10.0),
    ),
    FixedSpec(
        'roller_force',
        1e6,
        'Largest force along the tube of a roller, which stands where the members pull harder '
        'against it, mujoco only [N]',
        (1e-3, 1e6),
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
        gravity=(values.gravity_x, values.gravity_y),
        ground_friction=values.ground_friction,
        module_friction=values.module_friction,
        roller_lag=values.roller_lag,
        roller_force=values.roller_force,
    )
    longest = float('inf') if sim_time else LONGEST_STEP
    free, seed = values.object_is_free, values.seed
    return DrivenRobot(robot, body, free, options, faults, seed, longest)
