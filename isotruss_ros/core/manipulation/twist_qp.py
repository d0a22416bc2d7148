# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Quadratic programs (QP) for the largest progress along a twist under limits, at least cost (11).

    minimize   1/2 |C u|^2 - rho (s - s^2 / (4 reach))
    subject to J u = s * direction,  0 <= s <= reach,  lower <= G u <= upper

The second term is an exact penalty: its slope is at least rho / 2, which is larger than any
possible decrease of the first term. So the progress s is the largest possible one up to |C u|^2 /
rho, and the cost is minimal for this s. The direction must be scaled such that u and s have equal
magnitudes. Without binding limits the solution is `least_cost`. At binding limits `project_target`
deviates from the direction.
"""

from __future__ import annotations

from isotruss_ros.core.errors import SolverError
from isotruss_ros.core.manipulation.limits import Rows
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.qp import QuadraticProgram, solve_qp
import numpy as np

#: Penalties rho relative to |C u|^2 with |u| of order 1, tried one after another [-]. The first
#: penalty is exact up to rounding. The smaller penalties are for degenerate vertices; they
#: sacrifice progress.
PENALTIES = (1e8, 1e6, 1e4, 1e2, 1.0)
NO_SOLUTION = (
    'the quadratic program of the manipulation has no solution; '
    'the configuration is probably close to a singular one'
)


def maximize_progress(
    cost: Array,
    equality: Array,
    direction: Array,
    reach: float,
    limited: Rows,
    penalty: float = PENALTIES[0],
) -> tuple[Array, float]:
    """
    Return the speeds u with the largest progress s in a direction, at least cost.

    All quantities are dimensionless, and |u| is of order 1.

    :param cost: (r, r) matrix C^T C, positive definite.
    :param equality: (k, r) matrix J of full row rank.
    :param direction: (k,) direction in J u = s * direction.
    :param limited: (l, r) rows G with their bounds, which u = 0 fulfils.
    :return: speeds u (r,), and progress s.
    """
    inequality, lower, upper = limited
    r, count = cost.shape[0], len(inequality)
    hessian = np.zeros((r + 1, r + 1))
    hessian[:r, :r] = cost
    slope = np.zeros(r + 1)
    rows = np.zeros((2 * count + 2, r + 1))
    rows[:count, :r], rows[count:-2, :r] = inequality, -inequality
    rows[-2, r], rows[-1, r] = 1.0, -1.0
    bounds = np.concatenate([upper, -lower, [reach, 0.0]])
    equations = np.concatenate([equality, -direction[:, None]], axis=1)
    problem = QuadraticProgram(hessian, slope, rows, bounds, equations, np.zeros(len(direction)))
    # u = 0 is always admissible: the search failed at a degenerate vertex.
    for rho in [penalty, *(smaller for smaller in PENALTIES if smaller < penalty)]:
        hessian[r, r], slope[r] = rho / (2.0 * max(reach, 1.0)), -rho
        found = solve_qp(problem)
        if found is not None:
            return found[:r], float(min(max(found[r], 0.0), reach))
    raise SolverError(NO_SOLUTION)


def project_target(
    cost: Array, equality: Array, target: Array, rank: int, limited: Rows, regularization: float
) -> Array:
    """
    Return the speeds u for which J u is closest to a target, at least cost.

    They minimise 1/2 |J u - target|^2 + regularization/2 |C u|^2, where the first term has the
    first `rank` rows of J. The other rows are equalities; if the bounds do not admit their
    targets, these are replaced by 0. All quantities are dimensionless, and |u| is of order 1.

    :param cost: (r, r) matrix C^T C, positive definite.
    :param equality: (k, r) matrix J.
    :param target: (k,) desired value of J u.
    :param limited: (l, r) rows G with their bounds, which u = 0 fulfils.
    :return: (r,) speeds u.
    """
    inequality, lower, upper = limited
    reached, kept = equality[:rank], equality[rank:]
    rows, bounds = np.vstack([inequality, -inequality]), np.concatenate([upper, -lower])
    exact = target[rank:]
    for right in (exact, np.zeros(len(kept))) if exact.any() else (exact,):
        hessian = reached.T @ reached + regularization * cost
        gradient = -reached.T @ target[:rank]
        found = solve_qp(QuadraticProgram(hessian, gradient, rows, bounds, kept, right))
        if found is not None:
            return found
    raise SolverError(NO_SOLUTION)
