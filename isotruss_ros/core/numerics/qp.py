"""
One solve of a strictly convex quadratic program (QP), by SciPy's nonnegative least squares.

    minimize   1/2 x^T P x + q^T x
    subject to A x = b,  G x <= h,  lower <= x <= upper

What the equalities leave free and the Cholesky factor L of P turn it into the point of a
polyhedron that is nearest to the origin, and that into one problem of nonnegative least squares
(Lawson and Hanson, Solving Least Squares Problems, 1974, chapter 23, problem LDP). It ends after
finitely many exchanges also at corners of many limits, where dual active-set solvers give up now
and then, and it needs nothing but SciPy: one solver with and without ROS.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array
import numpy as np
import scipy
from scipy.linalg import lapack

#: Inequalities hold to this, against the largest of their coefficients times 1 + |x|.
TOLERANCE = 1e-9
#: Rows that the equalities leave shorter than this share of their length constrain nothing more.
PARALLEL = 1e-12
#: Of the search for the active constraints; it takes a few.
MAX_EXCHANGES = 1000
#: What is left by least squares is at right angles to the rest up to this.
ACCURACY = 1e-6
#: Where more constraints meet than there are directions, rounding misleads the search: it starts
#: again with bounds that are apart by so much, against the size of the solution.
RELAXATIONS = (0.0, 1e-9, 1e-7)
SMALLEST, EPSILON = float(np.finfo(float).tiny), float(np.finfo(float).eps)
GOLDEN_RATIO = 0.6180339887498949


class QuadraticProgram(NamedTuple):
    """
    A strictly convex quadratic program; all quantities are without units.

    :ivar hessian: (n, n) P, positive definite.
    :ivar gradient: (n,) q.
    :ivar rows: (l, n) G.
    :ivar bounds: (l,) h; infinite where there is no bound.
    :ivar lower: (n,) bounds of x; infinite where there is none, None if there are none at all.
    :ivar upper: (n,), None together with `lower`.
    :ivar equality: (k, n) A, of full row rank; None if there is none.
    :ivar target: (k,) b.
    """

    hessian: Array
    gradient: Array
    rows: Array
    bounds: Array
    lower: Array | None = None
    upper: Array | None = None
    equality: Array | None = None
    target: Array | None = None


def solve_qp(problem: QuadraticProgram) -> Array | None:
    """
    Return the solution of a quadratic program.

    :param problem: the program.
    :return: (n,) a point that fulfils the conditions of optimality, or None where none was found:
        the constraints contradict each other, or P is not positive definite.
    """
    rows, bounds = _inequalities(problem)
    free, start = _free_space(problem)
    whole = problem.equality is None
    curvature = problem.hessian if whole else free.T @ problem.hessian @ free
    # Variables of one size: P holds penalties up to 1e8 beside costs of 1.
    scale = 1.0 / np.sqrt(np.maximum(curvature.diagonal(), SMALLEST))
    factor, failed = lapack.dpotrf(scale[:, None] * curvature * scale, lower=1)
    if failed:
        return None
    free = free * scale
    # y = L^T z + offset is the distance from the minimum without inequalities.
    slope = free.T @ (problem.hessian @ start + problem.gradient)
    offset, _ = lapack.dtrtrs(factor, slope, lower=1)
    turned, _ = lapack.dtrtrs(factor, (rows * scale if whole else rows @ free).T, lower=1)
    room = bounds - rows @ start + offset @ turned
    tolerance = TOLERANCE * np.abs(rows).max(initial=0.0)
    for relaxation in RELAXATIONS:
        nearest = _least_distance(turned, room, np.sqrt(offset @ offset), relaxation)
        if nearest is None:
            continue
        step, _ = lapack.dtrtrs(factor, nearest - offset, lower=1, trans=1)
        found = start + free @ step
        if (rows @ found - bounds <= tolerance * (1.0 + np.abs(found).max())).all():
            return found
    return None


def _inequalities(problem: QuadraticProgram) -> tuple[Array, Array]:
    """Return all rows and bounds C x <= d."""
    rows, bounds = problem.rows, problem.bounds
    if problem.lower is not None and problem.upper is not None:
        unit = np.eye(len(problem.gradient))
        rows = np.concatenate([rows, unit, -unit])
        bounds = np.concatenate([bounds, problem.upper, -problem.lower])
    kept = bounds < np.inf
    return (rows, bounds) if kept.all() else (rows[kept], bounds[kept])


def _free_space(problem: QuadraticProgram) -> tuple[Array, Array]:
    """Return an orthonormal basis (n, f) of what the equalities leave free, and one solution."""
    n = len(problem.gradient)
    if problem.equality is None:
        return np.eye(n), np.zeros(n)
    k = len(problem.equality)
    packed, tau, _, _ = lapack.dgeqrf(np.asfortranarray(problem.equality.T))
    square = np.zeros((n, n), order='F')
    square[:, :k] = packed
    basis, _, _ = lapack.dorgqr(square, np.append(tau, np.zeros(n - k)))
    start, _ = lapack.dtrtrs(packed[:k], problem.target, trans=1)
    return basis[:, k:], basis[:, :k] @ start


def _least_distance(turned: Array, room: Array, size: float, relaxation: float) -> Array | None:
    """
    Return the y (f,) of the least length with y . column <= room for each column.

    :param turned: (f, l) columns.
    :param room: (l,)
    :param size: an estimate of that length.
    :param relaxation: by which the search for the active constraints sets the bounds apart.
    """
    lengths = np.sqrt(np.einsum('fl,fl->l', turned, turned))
    kept = lengths > PARALLEL * lengths.max(initial=0.0)
    if not kept.all():
        turned, room, lengths = turned[:, kept], room[kept], lengths[kept]
    columns, room = turned / lengths, room / lengths
    beyond = -room.min(initial=0.0)
    if beyond <= relaxation * size:
        return np.zeros(len(turned))
    size = max(size, beyond)
    matrix = np.concatenate([-columns, -room[None] / size])
    if relaxation:
        matrix[-1] -= relaxation * (1.0 + np.arange(len(room)) * GOLDEN_RATIO % 1.0)
    corner = np.zeros(len(matrix))
    corner[-1] = 1.0
    try:
        weights, _ = scipy.optimize.nnls(matrix, corner, maxiter=MAX_EXCHANGES)
    except RuntimeError:
        return None
    active = weights > 0.0
    left = corner - matrix[:, active] @ weights[active]
    # What is left is at right angles to what is not; nothing is where constraints contradict.
    if not EPSILON < left[-1] <= 1.0 or abs(left @ left - left[-1]) > ACCURACY:
        return None
    # The shortest y at these bounds: directions of very different stiffness keep their digits.
    shortest = columns[:, active].T
    target = np.zeros((max(shortest.shape), 1))
    target[: len(shortest), 0] = room[active]
    pivots = np.zeros(shortest.shape[1], dtype=np.intc)
    _, found, _, _, failed = lapack.dgelsy(shortest, target, pivots, PARALLEL, 16 * len(target))
    return None if failed else found[: shortest.shape[1], 0]
