# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
MuJoCo itself, an optional dependency, and what the robot file does not say of its model.

That is masses, damping, mesh and contact.
"""

from __future__ import annotations

from dataclasses import dataclass
import functools
import importlib
import math
from types import ModuleType

from isotruss_ros.core.errors import IsotrussError
from isotruss_ros.core.model.convex_object import DEFAULT_FRICTION
import numpy as np

#: Value of `local_stiffness` in the file of a robot whose tubes stay round where they are touched,
#: as they do in MuJoCo: dents stay below a micrometre.
ROUND = 1e4
#: Largest number of segments of a member; finer ones only cost time.
MAX_SEGMENTS = 64
POSITIVE = ('object_mass', 'module_mass', 'time_step')
NOT_NEGATIVE = (
    'friction',
    'joint_drag',
    'object_drag',
    'tube_relaxation',
    'ground_friction',
    'module_friction',
    'roller_lag',
)


class PlantError(IsotrussError, ValueError):
    """The MuJoCo plant cannot be made, or it left what it can simulate."""


@functools.cache
def load_mujoco() -> ModuleType:
    """
    Return the module `mujoco`.

    :raises PlantError: it is not installed; the text says how to install it.
    """
    try:
        return importlib.import_module('mujoco')
    except ImportError as error:
        raise PlantError(
            f'plant mujoco: MuJoCo cannot be imported ({error}); install it with '
            "pip install 'mujoco>=3.11,<4' in the environment of this Python, or take plant "
            'kinematic or elastic'
        ) from error


@dataclass(frozen=True)
class PlantOptions:
    """
    Settings of the MuJoCo model.

    :ivar tube_relaxation: time in which a tube that bends or shears would come to rest by its own
        losses, had it no mass [s].
    :ivar roller_force: largest force along the tube of a roller, its torque over its radius; it
        stands where the members it feeds pull harder against its motion [N].
    :raises PlantError: a value is not usable.
    """

    friction: float = DEFAULT_FRICTION  #: coefficient between tube and object
    object_mass: float = 0.5  #: of each object [kg]
    module_mass: float = 1.0  #: of each roller module [kg]
    gravity: tuple[float, float] = (0.0, 0.0)  #: (x, y) in the plane of the robot [m/s^2]
    time_step: float = 0.002  #: of the integrator [s]
    segments: int = 8  #: of each member: fewer press too little on an object
    joint_drag: float = 5.0  #: resistance of each joint of the robot against its speed [N s/m]
    tube_relaxation: float = 0.1
    object_drag: float = 0.5  #: resistance of the ground against an object's speed [N s/m]
    ground_friction: float = 0.0  #: at which a lying object begins to slide [N]
    module_friction: float = 0.0  #: the same for each joint of the robot with its modules [N]
    roller_lag: float = 0.0  #: time constant of the rollers' speeds behind their commands [s]
    roller_force: float = float('inf')

    def __post_init__(self) -> None:
        """Check the values."""
        for name in POSITIVE + NOT_NEGATIVE:
            value, words = getattr(self, name), 'positive' if name in POSITIVE else 'not negative'
            if not 0.0 <= value < math.inf or (name in POSITIVE and value == 0.0):
                raise PlantError(f'MuJoCo plant: {name} {value!r}: must be {words} and finite')
        if not self.roller_force > 0.0:
            raise PlantError(f'MuJoCo plant: roller_force {self.roller_force!r} N: not positive')
        if not np.isfinite(self.gravity).all():
            raise PlantError(f'MuJoCo plant: gravity {self.gravity!r}: must be finite')
        if not 1 <= self.segments <= MAX_SEGMENTS:
            raise PlantError(f'MuJoCo plant: members have 1 to {MAX_SEGMENTS} segments: {self}')
