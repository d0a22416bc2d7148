# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Carry a held disc to random goals: the environment of `isotruss_ros.learning` in a loop."""

from isotruss_ros.extras import explained_imports
import numpy as np

with explained_imports():
    import gymnasium
    from isotruss_ros.learning import ENVIRONMENT

env = gymnasium.make(ENVIRONMENT, max_episode_steps=60)
env.action_space.seed(0)


def policy(observation: np.ndarray) -> np.ndarray:
    """Return a twist toward the goal, proportional to the distance."""
    return (1.0, 1.0, 0.0) * observation[3:6]


for name, choose in (('random', lambda _: env.action_space.sample()), ('to the goal', policy)):
    distances = []
    for episode in range(3):
        observation, info = env.reset(seed=episode)
        ended = False
        while not ended:
            observation, reward, lost, late, info = env.step(choose(observation))
            ended = lost or late
        distances.append(info['distance'])
    print(f'{name}: {1000.0 * np.mean(distances):.1f} mm from the goal at the end')
