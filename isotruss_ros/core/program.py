"""
The quadratic program: as far along a direction as the limits allow, at the least cost.

    minimize   1/2 |C u|^2 - rho (s - s^2 / 4 reach)
    subject to J u = s * direction,  0 <= s <= reach,  lower <= G u <= upper

The second term is an exact penalty: its slope is at least rho / 2 everywhere, more than any saving
in the first term is worth, so s is the largest one possible, but for |C u|^2 / rho, and the cost
the least one there. That needs the direction scaled so that u and s are of like size. Where no
limit binds, `least` does it.
"""

from __future__ import annotations

import functools
import itertools

from isotruss_ros.core.errors import SolverError
import numpy as np
from numpy.typing import NDArray
import qpsolvers
from scipy.linalg import lapack

Array = NDArray[np.float64]

#: Solvers that are exact (active set) or nearly so (interior point), best for our size first.
PREFERRED = ('daqp', 'proxqp', 'piqp', 'quadprog', 'clarabel', 'cvxopt')
#: The default of daqp leaves inequalities open by 1e-6.
OPTIONS = {'daqp': {'primal_tol': 1e-9}}
#: J u = s * direction is to hold to this, with |u| of the order of 1; usually it does to 1e-13.
EQUALITY_TOLERANCE = 1e-8
#: rho, against |C u|^2 with |u| of the order of 1. The first is near enough to exact; where all
#: solvers stumble over it (corners at which next to nothing can move) the others stop sooner.
PENALTIES = (1e8, 1e6, 1e4, 1e2, 1.0)


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


def least(even: Array, equality: Array, direction: Array) -> Array:
    """
    Return the u (r,) of the least |C u|^2 with J u = direction, limits aside.

    :param even: (r, r) E with |C E y| = |y|.
    :param equality: (k, r) J, of full row rank.
    :param direction: (k,).
    """
    # u = E y with the shortest y that fulfils J E y = direction.
    right = np.zeros(even.shape[0])
    right[: len(direction)] = direction
    return even @ lapack.dgels(equality @ even, right)[1]


def furthest(
    cost: Array,
    equality: Array,
    direction: Array,
    reach: float,
    inequality: Array,
    lower: Array,
    upper: Array,
) -> tuple[Array, float]:
    """
    Solve the program of this module; all quantities are without units, |u| of the order of 1.

    :param cost: (r, r) C^T C, positive definite.
    :param equality: (k, r) J, of full row rank.
    :param direction: (k,) what J u is at s = 1.
    :param reach: the largest s that is of use, positive.
    :param inequality: (l, r) G.
    :param lower: (l,) not positive, so that u = 0 is a solution.
    :param upper: (l,) not negative.
    :return: u (r,) and s.
    :raises SolverError: the solver gave up.
    """
    r = cost.shape[0]
    hessian = np.zeros((r + 1, r + 1))
    hessian[:r, :r] = cost
    linear = np.zeros(r + 1)
    low, high = np.full(r + 1, -np.inf), np.full(r + 1, np.inf)
    low[r], high[r] = 0.0, reach
    # A row with one entry bounds one roller, which costs a solver next to nothing.
    present = inequality != 0.0
    entries = present.sum(axis=1)
    single, several = entries == 1, entries > 1
    place = present[single].argmax(axis=1)
    entry = inequality[single, place]
    one_end, other_end = lower[single] / entry, upper[single] / entry
    np.maximum.at(low, place, np.minimum(one_end, other_end))
    np.minimum.at(high, place, np.maximum(one_end, other_end))
    rows = np.column_stack([inequality[several], np.zeros(several.sum())])
    problem = qpsolvers.Problem(
        hessian,
        linear,
        np.vstack([rows, -rows]),
        np.concatenate([upper[several], -lower[several]]),
        np.column_stack([equality, -direction]),
        np.zeros(len(direction)),
        low,
        high,
    )
    # u = 0 always fits, so who finds nothing, or leaves J u = s * direction open, has met a
    # degenerate corner: ask the next.
    for penalty, solver in itertools.product(PENALTIES, installed_solvers()):
        problem.P[r, r], problem.q[r] = penalty / (2.0 * max(reach, 1.0)), -penalty
        found = qpsolvers.solve_problem(problem, solver, **OPTIONS.get(solver, {})).x
        if found is not None and np.abs(problem.A @ found).max() <= EQUALITY_TOLERANCE:
            return found[:r], float(min(max(found[r], 0.0), reach))
    raise SolverError(
        f'{", ".join(installed_solvers())} found no solution of the manipulation program; '
        'the configuration is probably next to a singular one'
    )
