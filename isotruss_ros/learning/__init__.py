# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Gymnasium environment of a held object, registered as `isotruss_ros/HeldObject-v0`.

Entry points: `HeldObjectEnv`, `HeldObjectVectorEnv`, `Transition`, `progress_reward`, and by
`gymnasium.make('isotruss_ros.learning:isotruss_ros/HeldObject-v0')` the registered environment.
Imports `core`, Gymnasium, and for pictures `plotting`.
"""

from isotruss_ros.extras import MissingPackageError

try:
    import gymnasium
    from isotruss_ros.learning.held_object_env import (
        HeldObjectEnv,
        HeldObjectVectorEnv,
        progress_reward,
        Transition,
    )
except ModuleNotFoundError as error:
    raise MissingPackageError(error) from error

__all__ = [
    'ENVIRONMENT',
    'HeldObjectEnv',
    'HeldObjectVectorEnv',
    'Transition',
    'progress_reward',
]

#: Name of the registered environment.
ENVIRONMENT = 'isotruss_ros/HeldObject-v0'

gymnasium.register(
    ENVIRONMENT,
    entry_point='isotruss_ros.learning.held_object_env:HeldObjectEnv',
    vector_entry_point='isotruss_ros.learning.held_object_env:HeldObjectVectorEnv',
    max_episode_steps=200,
)
