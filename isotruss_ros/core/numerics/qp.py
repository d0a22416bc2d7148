"""One solve of a quadratic program, by the first of the installed solvers that can."""

from __future__ import annotations

import functools

from isotruss_ros.core.errors import SolverError
from isotruss_ros.core.numerics.arrays import Array
import numpy as np
import qpsolvers

#: Solvers that are exact (active set) or nearly so (interior point), best for our size first.
PREFERRED = ('daqp', 'proxqp', 'piqp', 'quadprog', 'clarabel', 'cvxopt')
#: The default of daqp leaves inequalities open by 1e-6.
OPTIONS = {'daqp': {'primal_tol': 1e-9}}
#: J u = s * direction is to hold to this, with |u| of the order of 1; usually it does to 1e-13.
EQUALITY_TOLERANCE = 1e-8


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


def solve_qp(problem: qpsolvers.Problem) -> Array | None:
    """
    Return the solution of a quadratic program.

    A solver that finds nothing, or leaves the equalities open, has met a degenerate corner: the
    next one is tried.

    :param problem: minimize 1/2 x^T P x + q^T x subject to rows and bounds; P positive definite.
    :return: (n,), or None where no installed solver finds a solution.
    :raises SolverError: no solver is installed.
    """
    for solver in installed_solvers():
        found = qpsolvers.solve_problem(problem, solver, **OPTIONS.get(solver, {})).x
        if found is None:
            continue
        if problem.A is None or np.abs(problem.A @ found).max() <= EQUALITY_TOLERANCE:
            return found
    return None
