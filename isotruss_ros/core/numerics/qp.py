# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Strictly convex quadratic programs (QP), by SciPy's nonnegative least squares.

    minimize   1/2 x^T P x + q^T x
    subject to A x = b,  G x <= h,  lower <= x <= upper

What the equalities leave free and the Cholesky factor L of P turn it into the point of a
polyhedron that is nearest to the origin (Lawson and Hanson, Solving Least Squares Problems, 1974,
chapter 23, problem LDP):

    minimize |y|  subject to  y . column <= room  for each column

The search for it ends after finitely many exchanges also at corners of many limits, where dual
active-set solvers give up now and then, and it needs nothing but SciPy: one solver with and
without ROS. An answer is checked by duality, so that it is the nearest point or none.

Contact is such a program with x >= 0 alone, a linear complementarity problem: where contact is,
and how hard, equation (8). Principal pivoting ends it in a few steps.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.errors import SolverError
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices
import numpy as np
import scipy
from scipy.linalg import cholesky, lapack, solve_triangular

#: Inequalities hold to the first of these, against the largest of their coefficients times
#: 1 + |x|; to the second where planes that are next to dependent meet and no search comes closer.
TOLERANCE, LOOSE_TOLERANCE = 1e-9, 1e-8
#: Where more constraints meet than there are directions, rounding misleads the search: it starts
#: again with bounds that are apart by so much, against the size of the solution.
RELAXATIONS = (0.0, 1e-12, 1e-11, 1e-10, 1e-9)
SMALLEST = float(np.finfo(float).tiny)
#: Columns shorter than this share of the longest constrain nothing.
PARALLEL = 1e-12
#: Of the search for the active constraints; it takes a few.
MAX_EXCHANGES = 1000
#: |y|^2 is at most so much above the least, against the square of the size.
GAP = 1e-8
EPSILON = float(np.finfo(float).eps)
GOLDEN_RATIO = 0.6180339887498949
#: Gaps and complementarity hold to this [m]; forces to this over the stiffest point's compliance.
GAP_TOLERANCE = 1e-9
#: Exchanges of many points at once without fewer wrong ones, before least squares.
MAX_BLOCK_EXCHANGES = 10


class QuadraticProgram(NamedTuple):
    """
    A strictly convex quadratic program; all quantities are without units.

    :ivar hessian: (n, n) P, positive definite.
    :ivar gradient: (n,) q.
    :ivar rows: (l, n) G.
    :ivar bounds: (l,) h; infinite where there is no bound.
    :ivar lower: (n,) of x, infinite where there is no bound; None for none at all.
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
    largest = np.abs(rows).max(initial=SMALLEST)
    if not free.shape[1]:  # LAPACK takes no empty factor
        excess = (rows @ start - bounds).max(initial=0.0)
        return start if excess <= LOOSE_TOLERANCE * largest * (1.0 + np.abs(start).max()) else None
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
    best: Array | None = None
    least = LOOSE_TOLERANCE
    for relaxation in RELAXATIONS:
        nearest = find_nearest(turned, room, np.sqrt(offset @ offset), relaxation)
        if nearest is None:
            continue
        found, step, active = start, nearest.point - offset, nearest.active
        for _ in range(2):
            found = found + free @ lapack.dtrtrs(factor, step, lower=1, trans=1)[0]
            excess = (rows @ found - bounds).max(initial=0.0)
            beyond = excess / (largest * (1.0 + np.abs(found).max()))
            if beyond <= least:
                best, least = found, beyond
            if beyond <= TOLERANCE:
                return found
            if not len(active):
                break
            # An offset much longer than x has taken digits: the active constraints give them back.
            left = bounds[active] - rows[active] @ found
            step = solve_least_squares(turned[:, active].T, left)
    return best


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
    basis, _, _ = lapack.dorgqr(square, tau)
    start, _ = lapack.dtrtrs(packed[:k], problem.target, trans=1)
    return basis[:, k:], basis[:, :k] @ start


class Nearest(NamedTuple):
    """The point of a polyhedron that is nearest to the origin."""

    point: Array  #: (f,) y
    active: Indices  #: (a,) numbers of the constraints that keep it from the origin


def find_nearest(columns: Array, room: Array, size: float, relaxation: float) -> Nearest | None:
    """
    Return the point of a polyhedron that is nearest to the origin.

    :param columns: (f, l) its planes' normals, of any lengths.
    :param room: (l,) what y . column may be.
    :param size: an estimate of |y|, not negative.
    :param relaxation: by which the search for the active constraints sets the bounds apart,
        against the size; 0 or small.
    :return: None where none was found: the constraints contradict each other, or rounding has
        misled the search.
    """
    lengths = np.sqrt(np.einsum('fl,fl->l', columns, columns))
    lengths[lengths <= PARALLEL * lengths.max(initial=0.0)] = np.inf
    normals, bounds = columns / lengths, room / lengths
    beyond = -bounds.min(initial=0.0)
    if beyond <= relaxation * size:
        return Nearest(np.zeros(len(columns)), np.zeros(0, dtype=np.intp))
    size = max(size, beyond)
    matrix = np.concatenate([normals, bounds[None] / size])
    if relaxation:
        matrix[-1] += relaxation * (1.0 + np.arange(len(bounds)) * GOLDEN_RATIO % 1.0)
    corner = np.zeros(len(matrix))
    corner[-1] = -1.0
    try:
        weights, _ = scipy.optimize.nnls(matrix, corner, maxiter=MAX_EXCHANGES)
    except RuntimeError:
        return None
    active = np.flatnonzero(weights)
    left = 1.0 + matrix[-1, active] @ weights[active]
    # Nothing is left where constraints contradict, none is active where the relaxation put the
    # origin inside.
    if not EPSILON < left <= 1.0 or not len(active):
        return None
    normals, bounds = normals[:, active], bounds[active]
    # The shortest y at these bounds: directions of very different stiffness keep their digits.
    point = solve_least_squares(normals.T, bounds)
    # Duality: with multipliers that are not negative |y|^2 is at most the gap above the least.
    apart, multipliers = np.abs(bounds - point @ normals), weights[active] * (size / left)
    for _ in range(2):
        rest = point + normals @ multipliers
        if rest @ rest + 2.0 * multipliers @ apart <= GAP * size * size:
            return Nearest(point, active)
        multipliers = np.maximum(multipliers - solve_least_squares(normals, rest), 0.0)
    return None


def solve_least_squares(matrix: Array, right: Array) -> Array:
    """
    Return the shortest x with the least |matrix x - right|.

    In place of `numpy.linalg.lstsq(matrix, right, rcond=PARALLEL)`, without its singular values.

    :param matrix: (m, n), of any rank, m and n at least 1.
    :param right: (m,)
    """
    rows, columns = matrix.shape
    padded = np.zeros((max(rows, columns), 1))
    padded[:rows, 0] = right
    pivots = np.zeros(columns, dtype=np.intc)
    work = 16 * len(padded)
    return lapack.dgelsy(matrix, padded, pivots, PARALLEL, work)[1][:columns, 0]


def solve_complementarity(compliance: Array, gaps: Array, active: Flags) -> tuple[Array, Flags]:
    """
    Find forces f >= 0 with g = gaps + compliance @ f >= 0 and f g = 0, equations (6) and (8).

    By exchanging all points that are wrong at once (Judice and Pires, 1994), which takes a few
    steps or goes in circles; then by nonnegative least squares.

    :param compliance: (c, c) symmetric positive definite [m/N].
    :param gaps: (c,) without forces [m].
    :param active: (c,) a guess of where the contact is.
    :return: forces (c,) [N] and where they act.
    :raises SolverError: the matrix is not positive definite.
    """
    active = active.copy()
    best, progress_timeout = len(gaps) + 1, MAX_BLOCK_EXCHANGES
    while True:
        forces = np.zeros(len(gaps))
        forces[active] = _closing(compliance, gaps, active)
        left = gaps + compliance @ forces
        wrong = (active & (forces < 0.0)) | (~active & (left < -0.1 * GAP_TOLERANCE))
        count = int(wrong.sum())
        if count == 0:
            return forces, active
        if count < best:
            best, progress_timeout = count, MAX_BLOCK_EXCHANGES
        elif progress_timeout == 0:
            return _by_least_squares(compliance, gaps)
        progress_timeout -= 1
        active ^= wrong


def _by_least_squares(compliance: Array, gaps: Array) -> tuple[Array, Flags]:
    """Do the same with W = R^T R: 1/2 f W f + f g is 1/2 |R f + R^-T g|^2 but for a constant."""
    try:
        root = cholesky(compliance)
        target = solve_triangular(root, -gaps, trans='T')
        active = scipy.optimize.nnls(root, target, maxiter=100 + 20 * len(gaps))[0] > 0.0
    except (np.linalg.LinAlgError, RuntimeError) as error:
        raise SolverError('the complementarity problem was not solved') from error
    forces = np.zeros(len(gaps))
    forces[active] = np.maximum(_closing(compliance, gaps, active), 0.0)
    return forces, forces > 0.0


def _closing(compliance: Array, gaps: Array, active: Flags) -> Array:
    """Return the forces at the active points, of any sign, that close their gaps."""
    places = np.flatnonzero(active)
    if not len(places):
        return np.zeros(0)
    _, forces, failed = lapack.dposv(compliance[places[:, None], places], -gaps[places])
    if failed:
        raise SolverError('the contact compliance is not positive definite')
    return forces
