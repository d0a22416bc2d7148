# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

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
            "pip install 'mujoco>=3.11,<4' in the environment of this Python, or take plant "
            'kinematic or elastic'
        ) from error
