# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Maximise the slip margin of a grasp over the rollers, with exact gradients and constraints."""

from isotruss_ros import core
from isotruss_ros.core.holding.grasp_gradient import GraspGradient
import numpy as np
from scipy.optimize import minimize

home = core.load_robot('nine_member').home
members, pull = ('north/P-Z', 'north/Z-R'), (0.5, -2.0, 0.0)  # fx, fy [N], moment
body = core.place_between(home, members, core.Disc(0.3), indentation=0.01).body


def solve(travel: np.ndarray) -> GraspGradient:
    """Return the grasp at a travel of the rollers [m], with its derivatives."""
    config = home.moved_to(travel)
    return core.grasp_gradient(core.settle_grasp(config, body, 0.8, pull, members=members))


def cost(travel: np.ndarray) -> tuple[float, np.ndarray]:
    """Return minus the slip margin [N], and its gradient by the travel of the rollers [N/m]."""
    found = solve(travel)
    return -found.settled.slip_margin, -found.slip_margin[found.parameters.rollers]


def reserves(travel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the constraints (utilisation 0.6, displacement 2 cm) and their gradients."""
    found = solve(travel)
    own, way = found.parameters.rollers, found.settled.displacement[:2]
    left = np.append(0.6 - np.array([*found.settled.utilisation.values()]), 0.02**2 - way @ way)
    return left, -np.vstack([found.utilisation[:, own], 2.0 * way @ found.pose[:2, own]])


start, bounds = np.zeros(6), [(-0.05, 0.05)] * 6
limit = {'type': 'ineq', 'fun': lambda x: reserves(x)[0], 'jac': lambda x: reserves(x)[1]}
best = minimize(cost, start, jac=True, bounds=bounds, constraints=limit)
print(f'slip margin {-cost(start)[0]:.2f} N, then {-best.fun:.2f} N')
print(solve(best.x).settled)
