# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Learn to carry a loaded ellipse to random goals, by the cross-entropy method in plain NumPy.

A policy is a bounded linear function of the vector to the goal; the first one turns the object.
In each generation the mean and the standard deviation of its weights become those of the best
policies. Usage: python learn_to_carry.py [generations [policies]].
"""

import sys

from isotruss_ros.core import Ellipse
from isotruss_ros.extras import explained_imports
import numpy as np

with explained_imports():
    import gymnasium
    from isotruss_ros.learning import ENVIRONMENT

COUNTS = [int(text) for text in sys.argv[1:]]
GENERATIONS, POLICIES = COUNTS if len(COUNTS) == 2 else (8, 12)
EPISODES, STEPS, ELITE = 2, 15, 4
#: Largest displacement of a goal [m], and largest twist [m/s, m/s, rad/s].
RANGE, TWIST = 0.1, np.array([0.04, 0.04, 0.4])


def act(weights: np.ndarray, observed: np.ndarray) -> np.ndarray:
    """Return the twists (n, 3) of policies with weights (n, 3, 3)."""
    features = np.pad(observed[:, 3:5] / RANGE, ((0, 0), (0, 1)), constant_values=1.0)
    return (TWIST * np.tanh(np.einsum('nij,nj->ni', weights, features))).astype(np.float32)


def evaluate(weights: np.ndarray, seed: int) -> np.ndarray:
    """Return the return, the loss and the last distance [m] of one episode each, (3, n)."""
    observed, info = env.reset(seed=seed)
    running, returns = np.ones(POLICIES, dtype=bool), np.zeros(POLICIES)
    distances = info['distance']
    for _ in range(STEPS):
        observed, rewards, lost, _, info = env.step(act(weights, observed))
        returns += running * rewards
        distances = np.where(running, info['distance'], distances)
        running &= ~lost
    return np.array([returns, ~running, distances])


def judge(policy: np.ndarray) -> str:
    """Return the results of one policy for goals and loads that are not those of the learning."""
    _, lost, distances = evaluate(np.tile(policy, (POLICIES, 1, 1)), 10**6)
    kept = distances[lost == 0.0]
    error = f'{1e3 * kept.mean():4.0f} mm' if len(kept) else '   -'
    return f'{100.0 * lost.mean():4.0f} %  {error}'


env = gymnasium.make_vec(
    ENVIRONMENT,
    num_envs=POLICIES,
    vectorization_mode='vector_entry_point',
    max_episode_steps=STEPS + 1,
    shape=Ellipse((0.16, 0.13)),
    force=0.7,
    period=0.25,
    goal_range=(RANGE, RANGE, 0.0),
    max_twist=tuple(TWIST.tolist()),
)
rng = np.random.default_rng(3)
mean, deviation = np.zeros((3, 3)), np.ones((3, 3))
mean[2, 2] = -1.5
print('generation  lost  distance of the others from the goal')
print(f'{0:10d}  {judge(mean)}', flush=True)
for generation in range(1, GENERATIONS + 1):
    weights = mean + deviation * rng.normal(size=(POLICIES, 3, 3))
    seeds = [1000 * (EPISODES * generation + i) for i in range(EPISODES)]
    returns = sum(evaluate(weights, seed)[0] for seed in seeds)
    best = weights[np.argsort(-returns)[: min(ELITE, POLICIES // 2)]]
    mean, deviation = best.mean(axis=0), best.std(axis=0) + 0.1
    print(f'{generation:10d}  {judge(mean)}', flush=True)
peer = np.zeros((3, 3))
peer[0, 0] = peer[1, 1] = 3.0
print(f'solve_twist {judge(peer)}')
