"""
The quadratic program: as far along a direction as the limits allow, at the least cost.

    minimize   1/2 |C u|^2 - rho (s - s^2 / 4 reach)
    subject to J u = s * direction,  0 <= s <= reach,  lower <= G u <= upper

The second term is an exact penalty: its slope is at least rho / 2 everywhere, more than any saving
in the first term is worth, so s is the largest one possible, but for |C u|^2 / rho, and the cost
the least one there. That needs the direction scaled so that u and s are of like size. Where no
limit binds, `least` does it. `nearest` gives the direction up where limits are in the way.
"""

from __future__ import annotations

import functools
import itertools
from typing import NamedTuple

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
NO_SOLUTION = (
    '{} found no solution of the manipulation program; '
    'the configuration is probably next to a singular one'
)


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
    worth: float = PENALTIES[0],
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
    :param worth: rho, what progress is worth against the cost; large for as far as possible.
    :return: u (r,) and s.
    :raises SolverError: the solver gave up.
    """
    r = cost.shape[0]
    hessian = np.zeros((r + 1, r + 1))
    hessian[:r, :r] = cost
    box = _box(inequality, lower, upper)
    rows = np.column_stack([box.rows, np.zeros(len(box.rows))])
    problem = qpsolvers.Problem(
        hessian,
        np.zeros(r + 1),
        rows,
        box.bounds,
        np.column_stack([equality, -direction]),
        np.zeros(len(direction)),
        np.append(box.low, 0.0),
        np.append(box.high, reach),
    )
    # u = 0 always fits, so who finds nothing, or leaves J u = s * direction open, has met a
    # degenerate corner: ask the next.
    penalties = [worth, *(penalty for penalty in PENALTIES if penalty < worth)]
    for penalty, solver in itertools.product(penalties, installed_solvers()):
        problem.P[r, r], problem.q[r] = penalty / (2.0 * max(reach, 1.0)), -penalty
        found = _solve(problem, solver)
        if found is not None:
            return found[:r], float(min(max(found[r], 0.0), reach))
    raise SolverError(NO_SOLUTION.format(', '.join(installed_solvers())))


def nearest(
    cost: Array,
    equality: Array,
    target: Array,
    rank: int,
    inequality: Array,
    lower: Array,
    upper: Array,
    thrift: float,
) -> Array:
    """
    Return the u of which J u comes nearest to a target within bounds, at the least cost there.

    Minimizes 1/2 |J u - target|^2 + thrift/2 |C u|^2 over the first `rank` rows of J; the
    others hold as J u = 0. All quantities are without units, |u| of the order of 1.

    :param cost: (r, r) C^T C, positive definite.
    :param equality: (k, r) J.
    :param target: (k,), zero from `rank` on.
    :param inequality: (l, r) G.
    :param lower: (l,) not positive, so that u = 0 is admissible.
    :param upper: (l,) not negative.
    :param thrift: what a unit of cost weighs; next to nothing for as near as possible.
    :return: (r,)
    :raises SolverError: the solver gave up.
    """
    wanted, kept = equality[:rank], equality[rank:]
    box = _box(inequality, lower, upper)
    problem = qpsolvers.Problem(
        wanted.T @ wanted + thrift * cost,
        -wanted.T @ target[:rank],
        box.rows,
        box.bounds,
        kept if len(kept) else None,
        np.zeros(len(kept)) if len(kept) else None,
        box.low,
        box.high,
    )
    for solver in installed_solvers():
        found = _solve(problem, solver)
        if found is not None:
            return found
    raise SolverError(NO_SOLUTION.format(', '.join(installed_solvers())))


class _Box(NamedTuple):
    """Bounds low <= u <= high and rows @ u <= bounds, (r,), (r,), (l, r) and (l,)."""

    low: Array
    high: Array
    rows: Array
    bounds: Array


def _box(inequality: Array, lower: Array, upper: Array) -> _Box:
    """Sort rows: one with a single entry bounds one roller, which costs next to nothing."""
    r = inequality.shape[1]
    low, high = np.full(r, -np.inf), np.full(r, np.inf)
    present = inequality != 0.0
    entries = present.sum(axis=1)
    single, several = entries == 1, entries > 1
    place = present[single].argmax(axis=1)
    entry = inequality[single, place]
    one_end, other_end = lower[single] / entry, upper[single] / entry
    np.maximum.at(low, place, np.minimum(one_end, other_end))
    np.minimum.at(high, place, np.maximum(one_end, other_end))
    rows = inequality[several]
    bounds = np.concatenate([upper[several], -lower[several]])
    return _Box(low, high, np.vstack([rows, -rows]), bounds)


def _solve(problem: qpsolvers.Problem, solver: str) -> Array | None:
    """Return the solution, or None where there is none, or the equalities are left open."""
    found = qpsolvers.solve_problem(problem, solver, **OPTIONS.get(solver, {})).x
    if found is None:
        return None
    left = np.abs(problem.A @ found).max() if problem.A is not None else np.abs(found).max() * 0.0
    return found if left <= EQUALITY_TOLERANCE else None
