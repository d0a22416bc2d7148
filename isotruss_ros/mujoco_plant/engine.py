"""MuJoCo itself, which is an optional dependency: imported when a plant is made."""

from __future__ import annotations

import functools
import importlib
from types import ModuleType

from isotruss_ros.mujoco_plant.options import PlantError


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
            "pip install 'isotruss_ros[mujoco]', or take plant kinematic or elastic"
        ) from error
