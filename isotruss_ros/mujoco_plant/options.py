# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Import of MuJoCo, which is an optional dependency, and the options of its model.

The options are values that a robot file does not contain: masses, damping, mesh and contact.
"""

from __future__ import annotations

from dataclasses import dataclass
import functools
import importlib
import math
from pathlib import Path
from types import ModuleType

from isotruss_ros.core.errors import IsotrussError
from isotruss_ros.core.model.convex_object import check_friction, DEFAULT_FRICTION
from isotruss_ros.core.model.presets import find_robot_file
import numpy as np
from ruamel.yaml import YAML

#: Value of `local_stiffness` with which cross sections do not flatten, as in MuJoCo; their
#: indentation is below a micrometre.
RIGID_SECTION_STIFFNESS = 1e4
#: Largest number of segments of a member [-]; more segments do not increase the accuracy.
MAX_SEGMENTS = 64
POSITIVE_OPTIONS = ('object_mass', 'time_step')
NONNEGATIVE_OPTIONS = (
    'friction',
    'joint_drag',
    'object_drag',
    'tube_relaxation',
    'ground_friction',
    'module_friction',
    'roller_lag',
)


class PlantError(IsotrussError, ValueError):
    """Error: the MuJoCo plant cannot be created, or the simulation diverged."""


@functools.cache
def load_mujoco() -> ModuleType:
    """
    Return the imported module `mujoco`.

    :raises PlantError: MuJoCo is not installed; the message names the command to install it.
    """
    try:
        return importlib.import_module('mujoco')
    except ImportError as error:
        raise PlantError(
            f'plant mujoco: MuJoCo cannot be imported ({error}); install it with '
            "pip install 'mujoco>=3.11,<4' in the environment of this Python, or use plant "
            'kinematic or elastic'
        ) from error


def write_round_robot(robot: str | Path, folder: Path) -> Path:
    """
    Write a robot file whose tubes do not flatten, as in MuJoCo, and return its path.

    :param robot: name of a preset, or path of a robot file.
    """
    yaml = YAML(typ='safe', pure=True)
    # The order of tubes is that of the rollers.
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    file = find_robot_file(robot)
    content = yaml.load(file.read_text(encoding='utf-8'))
    content['tube']['local_stiffness'] = RIGID_SECTION_STIFFNESS
    path = folder.resolve() / f'{file.stem}_round.yaml'
    with path.open('w', encoding='utf-8') as written:
        yaml.dump(content, written)
    return path


@dataclass(frozen=True)
class PlantOptions:
    """
    Options of the MuJoCo model.

    :raises PlantError: a value is invalid.
    """

    friction: float = DEFAULT_FRICTION  #: coefficient of friction between tube and object [-]
    object_mass: float = 0.5  #: mass of an object [kg]
    gravity: tuple[float, float] = (0.0, 0.0)  #: gravity (x, y) in the robot's plane [m/s^2]
    time_step: float = 0.002  #: time step of the integrator [s]
    segments: int = 8  #: number of segments of a member; with fewer, the squeeze is too small
    joint_drag: float = 5.0  #: viscous drag of each joint of the robot [N s/m]
    #: relaxation time of a massless tube in bending and shear, which represents material losses
    #: [s]
    tube_relaxation: float = 0.1
    object_drag: float = 0.5  #: viscous drag of the ground on an object [N s/m]
    ground_friction: float = 0.0  #: friction force of the ground on an object [N]
    module_friction: float = 0.0  #: ground friction force on each joint with its modules [N]
    roller_lag: float = 0.0  #: time constant at which roller speeds follow commands [s]
    #: largest force of a roller along the tube, which is the roller's torque divided by its radius
    #: [N]. A roller stops if its members resist the motion with a larger force.
    roller_force: float = float('inf')

    def __post_init__(self) -> None:
        """Check the values."""
        for name in POSITIVE_OPTIONS + NONNEGATIVE_OPTIONS:
            value, words = (
                getattr(self, name),
                'positive' if name in POSITIVE_OPTIONS else 'not negative',
            )
            if not 0.0 <= value < math.inf or (name in POSITIVE_OPTIONS and value == 0.0):
                raise PlantError(f'MuJoCo plant: {name} {value!r}: must be {words} and finite')
        check_friction(self.friction, 'MuJoCo plant: friction')
        if not self.roller_force > 0.0:
            raise PlantError(f'MuJoCo plant: roller_force {self.roller_force!r} N: must be > 0')
        if not np.isfinite(self.gravity).all():
            raise PlantError(f'MuJoCo plant: gravity {self.gravity!r}: must be finite')
        if not 1 <= self.segments <= MAX_SEGMENTS:
            raise PlantError(
                f'MuJoCo plant: segments {self.segments}: must be from 1 to {MAX_SEGMENTS}'
            )
