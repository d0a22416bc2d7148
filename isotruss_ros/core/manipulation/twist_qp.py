# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Quadratic programs (QP) for the largest progress along a twist under limits, at least cost (11).

    minimize   1/2 |C (u - s f)|^2 - rho (s - s^2 / (4 reach))
    subject to J u = s * direction,  0 <= s <= reach,  lower <= G u <= upper

with the least-cost speeds f of `least_cost`. J (u - s f) = 0, so the first term is
1/2 |C u|^2 - 1/2 s^2 |C f|^2. The second term is an exact penalty if rho is large: its slope is at
least rho / 2. Then the progress s is the largest possible one, and the cost is minimal for this s.
The direction must be scaled such that u and s have equal magnitudes. Without binding limits the
solution is reach * f for every rho. At binding limits `least_deviation` deviates from the
direction.
"""

from __future__ import annotations

from isotruss_ros.core.manipulation.limits import Rows
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.qp import QuadraticProgram, require_solution, solve_qp
import numpy as np

#: Penalty rho relative to |C u|^2 with |u| of order 1 that is exact up to rounding [-].
EXACT_PENALTY = 1e8


def maximize_progress(
    cost: Array,
    equality: Array,
    direction: Array,
    reach: float,
    limited: Rows,
    least: float,
    penalty: float = EXACT_PENALTY,
) -> tuple[Array, float]:
    """
    Return the speeds u and the largest s with J u = s * direction, at least cost.

    |u| is of order 1, J has full row rank, and `least` is the least cost |C f|^2 for s = 1.
    """
    inequality, lower, upper = limited
    r, count = cost.shape[0], len(inequality)
    hessian, slope = np.zeros((r + 1, r + 1)), np.zeros(r + 1)
    hessian[:r, :r] = cost
    hessian[r, r], slope[r] = penalty / (2.0 * max(reach, 1.0)) - least, -penalty
    rows = np.zeros((2 * count + 2, r + 1))
    rows[:count, :r], rows[count:-2, :r] = inequality, -inequality
    rows[-2, r], rows[-1, r] = 1.0, -1.0
    bounds = np.concatenate([upper, -lower, [reach, 0.0]])
    equations = np.concatenate([equality, -direction[:, None]], axis=1)
    problem = QuadraticProgram(hessian, slope, rows, bounds, equations, np.zeros(len(direction)))
    solution = require_solution(solve_qp(problem))
    return solution[:r], float(min(max(solution[r], 0.0), reach))


def least_deviation(
    cost: Array, equality: Array, rank: int, opening: Array, limited: Rows, regularization: float
) -> Array:
    """
    Return the least change v of roller speeds that fulfils the limits on v.

    It minimises 1/2 |J v|^2 + regularization/2 |C v|^2 with the first `rank` rows of J. The other
    rows are equalities J v = 0; if the bounds do not admit them, they become J v = -opening.
    """
    inequality, lower, upper = limited
    reached, kept = equality[:rank], equality[rank:]
    rows, bounds = np.vstack([inequality, -inequality]), np.concatenate([upper, -lower])
    hessian, gradient = reached.T @ reached + regularization * cost, np.zeros(len(cost))
    problem = QuadraticProgram(hessian, gradient, rows, bounds, kept, np.zeros(len(kept)))
    change = solve_qp(problem)
    if change is None:
        change = solve_qp(problem._replace(target=-opening))
    return require_solution(change)
