# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Find shape and pressures with which a grasp presses most while no tube nears wrinkling."""

from functools import lru_cache
from typing import Any

from isotruss_ros import core
import numpy as np
from scipy.optimize import minimize

home = core.load_robot('nine_member').home
members, load, bound = ('north/P-Z', 'north/Z-R'), (0.0, -2.0, 0.0), 0.6
body = core.place_between(home, members, core.Disc(0.3), indentation=0.01).body
# Travel of the rollers in cm, pressures in units of 10 kPa.
scale = np.append(np.full(6, 0.01), np.full(3, 1e4))
start = np.append(np.zeros(6), np.full(3, 3.45))


@lru_cache(maxsize=1)
def solve(values: tuple[float, ...]) -> tuple[Any, ...]:
    """Return minus the squeeze, what utilisation is left, both with derivatives, and the grasp."""
    rollers, pressures = np.split(scale * values, [6])
    grasp = core.settle_grasp(home.moved_to(rollers), body, 0.8, load, pressures, members)
    gradient = core.grasp_gradient(grasp)
    chosen = np.r_[gradient.parameters.rollers, gradient.parameters.pressures]
    presses, left = np.mean([*grasp.normal_forces.values()]), [*grasp.utilisation.values()]
    by_shape, used = scale * gradient.squeeze[chosen], scale * gradient.utilisation[:, chosen]
    return -presses, -by_shape, bound - np.array(left), -used, grasp


reserve, by_shape = (lambda x: solve(tuple(x))[2]), (lambda x: solve(tuple(x))[3])
limit = {'type': 'ineq', 'fun': reserve, 'jac': by_shape}
box = [(-5.0, 5.0)] * 6 + [(2.5, 4.5)] * 3
best = minimize(lambda x: solve(tuple(x))[:2], start, jac=True, bounds=box, constraints=limit)
before, after, held = -solve(tuple(start))[0], -best.fun, solve(tuple(best.x))[-1].held
print(f'squeeze {before:.1f} N, then {after:.1f} N; held: {held}; {best.nfev} evaluations')
