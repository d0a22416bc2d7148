"""
The quadratic program: as far along a direction as the limits allow, at the least cost.

    minimize   1/2 |C u|^2 - rho (s - s^2 / 4 reach)
    subject to J u = s * direction,  0 <= s <= reach,  lower <= G u <= upper

The second term is an exact penalty: its slope is at least rho / 2 everywhere, more than any saving
in the first term is worth, so s is the largest one possible and the cost the least one there. That
needs the direction scaled so that u and s are of like size; where no limit binds, `least` does it.
"""

from __future__ import annotations

import functools

from isotruss_ros.core.errors import SolverError
import numpy as np
from numpy.typing import NDArray
import qpsolvers

Array = NDArray[np.float64]

#: Solvers that are exact (active set) or nearly so (interior point), best for our size first.
PREFERRED = ('daqp', 'proxqp', 'piqp', 'quadprog', 'clarabel', 'cvxopt')
#: The default of daqp leaves inequalities open by 1e-6.
OPTIONS = {'daqp': {'primal_tol': 1e-9}}
#: rho, against |C u|^2 with |u| of the order of 1.
PENALTY = 1e6


@functools.lru_cache(maxsize=1)
def installed_solvers() -> tuple[str, ...]:
    """
    Return the solvers at hand, best first.

    :raises SolverError: none of those that this package knows is installed.
    """
    names = tuple(name for name in PREFERRED if name in qpsolvers.available_solvers)
    if not names:
        raise SolverError(
            f'no solver for quadratic programs is installed; install one of {", ".join(PREFERRED)}'
        )
    return names


def least(cost: Array, equality: Array, direction: Array) -> Array:
    """
    Return the u (r,) of the least |C u|^2 with J u = direction, limits aside.

    :param cost: (r, r) C^T C, positive definite.
    :param equality: (k, r) J, of full row rank.
    :param direction: (k,).
    """
    root = np.linalg.cholesky(cost)
    # |C u| = |y| with y = root^T u, and the shortest y lies in the span of the rows.
    span, factor = np.linalg.qr(np.linalg.solve(root, equality.T))
    return np.linalg.solve(root.T, span @ np.linalg.solve(factor.T, direction))


def furthest(
    cost: Array, equality: Array, direction: Array, reach: float, inequality: Array, bound: Array
) -> tuple[Array, float]:
    """
    Solve the program of this module; all quantities are without units, |u| of the order of 1.

    :param cost: (r, r) C^T C, positive definite.
    :param equality: (k, r) J, of full row rank.
    :param direction: (k,) what J u is at s = 1.
    :param reach: the largest s that is of use, positive.
    :param inequality: (l, r) rows of G u <= bound.
    :param bound: (l,) not negative, so that u = 0 is a solution.
    :return: u (r,) and s.
    :raises SolverError: the solver gave up.
    """
    r = cost.shape[0]
    hessian = np.zeros((r + 1, r + 1))
    hessian[:r, :r] = cost
    hessian[r, r] = PENALTY / (2.0 * max(reach, 1.0))
    linear = np.zeros(r + 1)
    linear[r] = -PENALTY
    low, high = np.full(r + 1, -np.inf), np.full(r + 1, np.inf)
    low[r], high[r] = 0.0, reach
    problem = qpsolvers.Problem(
        hessian,
        linear,
        np.column_stack([inequality, np.zeros(len(bound))]),
        bound,
        np.column_stack([equality, -direction]),
        np.zeros(len(direction)),
        low,
        high,
    )
    # u = 0 always fits, so a solver that finds nothing has met a degenerate corner: ask the next.
    for solver in installed_solvers():
        found = qpsolvers.solve_problem(problem, solver, **OPTIONS.get(solver, {})).x
        if found is not None and np.isfinite(found).all():
            return found[:r], float(min(max(found[r], 0.0), reach))
    raise SolverError(
        f'{", ".join(installed_solvers())} found no solution of the manipulation program; '
        'the configuration is probably next to a singular one'
    )
