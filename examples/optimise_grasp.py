# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Find shape and pressures of a grasp that carries most: writes optimised.png."""

from functools import lru_cache

from isotruss_ros import core, plotting
from matplotlib.figure import Figure
import numpy as np
from scipy.optimize import minimize

home = core.load_robot('nine_member').home
members, load, most = ('north/P-Z', 'north/Z-R'), (0.0, -2.0, 0.0), 0.6
body = core.place_between(home, members, core.Disc(0.3), indentation=0.01).body
# Travel of six rollers in cm, pressures of three tubes in units of 10 kPa.
scale, start = np.repeat([0.01, 1e4], [6, 3]), np.repeat([0.0, 3.45], [6, 3])


@lru_cache(maxsize=1)
def solve(values: tuple[float, ...]) -> tuple:
    """Return minus the slip margin, what utilisation is left, with derivatives, and the grasp."""
    rollers, pressures = np.split(scale * values, [6])
    grasp = core.settle_grasp(home.moved_to(rollers), body, 0.8, load, pressures, members)
    gradient = core.grasp_gradient(grasp)
    chosen = np.r_[gradient.parameters.rollers, gradient.parameters.pressures]
    slope, used = scale * gradient.slip_margin[chosen], scale * gradient.utilisation[:, chosen]
    return -grasp.slip_margin, -slope, most - np.array([*grasp.utilisation.values()]), -used, grasp


limit = {'type': 'ineq', 'fun': lambda x: solve(tuple(x))[2], 'jac': lambda x: solve(tuple(x))[3]}
box = [(-5.0, 5.0)] * 6 + [(2.5, 4.5)] * 3
best = minimize(lambda x: solve(tuple(x))[:2], start, jac=True, bounds=box, constraints=limit)
figure = Figure(figsize=(9.0, 4.8), layout='constrained')
for values, axes in zip((start, best.x), figure.subplots(1, 2), strict=True):
    margin, _, left, _, grasp = solve(tuple(values))
    grip, used = grasp.equilibrium, most - left.min()
    title = f'slip margin {-margin:.1f} N, utilisation {used:.2f}, held: {grasp.held}'
    analysis = core.analyze_grasp(grip.config, grip.body, 0.8, load, pressure=grip.tubes.pressure)
    plotting.plot_grasp(grip.config, grip.body, analysis, axes, scale=0.006).set_title(title)
    print(title)
figure.savefig('optimised.png')
