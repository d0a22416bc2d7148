# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Optimise configuration and pressures of a grasp for its slip margin: writes optimised.png."""

from isotruss_ros import core
from isotruss_ros.extras import explained_imports
import numpy as np
from scipy.optimize import minimize

with explained_imports():
    from isotruss_ros import plotting
    from matplotlib.figure import Figure

robot = core.load_robot('nine_member')
members, load = ('north/P-Z', 'north/Z-R'), (0.5, -2.0, 0.0)
body = core.place_between(robot.home, members, core.Disc(0.3), indentation=0.01).body
unit = np.append(np.ones(6), [*robot.description.pressures.values()])  # [m], [Pa]
start, bounds = np.repeat([0.0, 1.0], [6, 3]), [(-0.05, 0.05)] * 6 + [(0.7, 1.3)] * 3


def solve(values: np.ndarray) -> tuple:
    """Return minus the slip margin, the constraints, gradients, and the grasp."""
    travel, pressures = np.split(unit * values, [6])
    grasp = core.settle_grasp(robot.configuration(travel), body, 0.8, load, pressures, members)
    found, way = core.grasp_gradient(grasp), grasp.displacement[:2]
    own = np.r_[found.parameters.rollers, found.parameters.pressures]
    left = np.append(0.6 - np.array([*grasp.utilisation.values()]), 0.02**2 - way @ way)
    slopes = np.vstack([found.utilisation[:, own], 2.0 * way @ found.pose[:2, own]])
    return -grasp.slip_margin, -unit * found.slip_margin[own], left, -unit * slopes, grasp


limit = {'type': 'ineq', 'fun': lambda x: solve(x)[2], 'jac': lambda x: solve(x)[3]}
best = minimize(lambda x: solve(x)[:2], start, jac=True, bounds=bounds, constraints=limit)
figure = Figure(figsize=(9.0, 4.8), layout='constrained')
for values, axes in zip((start, best.x), figure.subplots(1, 2), strict=True):
    grasp = solve(values)[-1]
    plotting.plot_grasp(grasp.equilibrium, axes, scale=0.006)
    used = max(grasp.utilisation.values())
    print(f'slip margin {grasp.slip_margin:.2f} N, utilisation {used:.2f}, held: {grasp.held}')
figure.savefig('optimised.png')
