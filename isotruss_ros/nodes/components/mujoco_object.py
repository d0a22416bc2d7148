# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What the parameters of `simulator` are to a robot in MuJoCo, and what it reports."""

from __future__ import annotations

from pathlib import Path

from isotruss_ros.core import RollerFaults
from isotruss_ros.mujoco_plant.driven_robot import DrivenRobot
from isotruss_ros.mujoco_plant.options import PlantOptions
from isotruss_ros.mujoco_plant.plant import MujocoPlant
from isotruss_ros.mujoco_plant.recording import PlantRecorder
from isotruss_ros.nodes.components.simulated_object import FRICTION, StartingObject
from isotruss_ros.nodes.framework import parameters as params

#: More than this is not simulated at once where time is the wall's, but reported as lag [s].
LONGEST_STEP = 0.1

OBJECT_MASS = params.Spec(
    'object_mass', 0.5, 'Mass of the object, mujoco only [kg]', bounds=(0.01, 1e3), read_only=True
)
MODULE_MASS = params.Spec(
    'module_mass',
    1.0,
    'Mass of a roller module, mujoco only [kg]',
    bounds=(0.01, 1e3),
    read_only=True,
)
GRAVITY_X = params.Spec(
    'gravity_x',
    0.0,
    'Gravity along x, mujoco only; not zero where the robot stands upright [m/s^2]',
    bounds=(-20.0, 20.0),
    read_only=True,
)
GRAVITY_Y = params.Spec(
    'gravity_y',
    0.0,
    'Gravity along y, mujoco only; not zero where the robot stands upright [m/s^2]',
    bounds=(-20.0, 20.0),
    read_only=True,
)
GROUND_FRICTION = params.Spec(
    'ground_friction',
    0.0,
    'Force at which the object begins to slide on the ground, mujoco (along x or y) and, held, '
    'elastic [N]',
    bounds=(0.0, 1e3),
    read_only=True,
)
MODULE_FRICTION = params.Spec(
    'module_friction',
    0.0,
    'Force at which a joint of the robot begins to slide on the floor, mujoco (along x or y) and, '
    'where it holds the object, elastic [N]',
    bounds=(0.0, 1e3),
    read_only=True,
)
ROLLER_LAG = params.Spec(
    'roller_lag',
    0.0,
    'Time constant of the rollers behind their commands, mujoco only [s]',
    bounds=(0.0, 10.0),
    read_only=True,
)
ROLLER_FORCE = params.Spec(
    'roller_force',
    1e6,
    'Largest force along the tube of a roller, which stands where the members pull harder against '
    'it, mujoco only [N]',
    bounds=(1e-3, 1e6),
    read_only=True,
)
RECORDING = params.Spec(
    'recording',
    '',
    'File to which the states of MuJoCo are written, to be drawn later; none if empty',
    read_only=True,
)
MUJOCO_SPECS = (
    OBJECT_MASS,
    MODULE_MASS,
    GRAVITY_X,
    GRAVITY_Y,
    GROUND_FRICTION,
    MODULE_FRICTION,
    ROLLER_LAG,
    ROLLER_FORCE,
    RECORDING,
)


def make_recorder(plant: MujocoPlant | None, path: str) -> PlantRecorder | None:
    """
    Return what writes the states of a plant to a file; None where no file is given.

    :param plant: in MuJoCo; None for another one.
    :param path: of the file, empty for none.
    :raises IsotrussError: the file cannot be written, or the plant is another one.
    """
    if not path:
        return None
    if plant is None:
        raise params.ParameterError(
            f'parameter recording: {path!r}: must be empty but with plant mujoco'
        )
    return PlantRecorder(plant, Path(path))


def make_driven_robot(
    start: StartingObject,
    values: params.Parameters,
    faults: RollerFaults,
    seed: int,
    sim_time: bool,
) -> DrivenRobot:
    """
    Return a robot in MuJoCo, at home, with its object.

    :param start: the object; a mass of its own counts instead of `object_mass`.
    :param values: of `MUJOCO_SPECS`, and the coefficient of friction.
    :param faults: how the rollers differ from perfect ones.
    :param seed: of the noise and the slip.
    :param sim_time: time is simulated, so that nothing can lag behind it.
    :raises IsotrussError: MuJoCo is not installed, or a value is not usable.
    """
    options = PlantOptions(
        friction=values[FRICTION],
        object_mass=values[OBJECT_MASS],
        module_mass=values[MODULE_MASS],
        gravity=(values[GRAVITY_X], values[GRAVITY_Y]),
        ground_friction=values[GROUND_FRICTION],
        module_friction=values[MODULE_FRICTION],
        roller_lag=values[ROLLER_LAG],
        roller_force=values[ROLLER_FORCE],
    )
    longest = float('inf') if sim_time else LONGEST_STEP
    return DrivenRobot(start.robot, start.body, start.is_free, options, faults, seed, longest)
