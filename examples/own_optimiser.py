# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Move the rollers until a grasp bears more: the slip margin as the cost of an optimiser."""

from isotruss_ros import core
import numpy as np
from scipy.optimize import minimize

robot = core.load_robot('nine_member')
body = core.ConvexObject.disc((0.5, 0.3), 0.3)
plan = core.plan_grasps(robot.home, body, core.GraspRequirements(squeeze=15.0, count=1))
start, members = plan[0].path[-1], plan[0].members


def cost(travel: np.ndarray) -> float:
    """Return minus the slip margin [N]; what holds nothing costs more than any grasp."""
    try:
        grasp = core.settle_grasp(robot.configuration(travel), body, 0.5, members=members)
    except core.IsotrussError:
        return 10.0
    return -grasp.slip_margin if grasp.held else 10.0


simplex = start + 0.01 * np.vstack([np.zeros(6), np.eye(6)])  # steps of 1 cm of roller travel
options = {'maxfev': 150, 'initial_simplex': simplex}
found = minimize(cost, start, method='Nelder-Mead', options=options)
print(f'slip margin {-cost(start):.1f} N, then {-found.fun:.1f} N')
