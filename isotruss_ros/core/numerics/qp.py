# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Strictly convex quadratic programs (QP), solved by SciPy's nonnegative least squares.

    minimize   1/2 x^T P x + q^T x
    subject to A x = b,  G x <= h

The null space of the equalities and the Cholesky factor L of P reduce it to the problem of the
point y of a polyhedron that is nearest to the origin (least distance programming, Lawson and
Hanson, Solving Least Squares Problems, 1974, chapter 23):

    minimize |y|  subject to  y . column <= room  for the normal (column) of each plane

The active-set search ends after finitely many steps even at degenerate vertices, where dual
active-set solvers fail occasionally. Only SciPy is needed, so the solver is the same with and
without ROS. Each solution is checked by duality.

The contact problem (8) is such a program with x >= 0 as its only constraint: a linear
complementarity problem (LCP), which is the nonnegative least squares of a Cholesky factor.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.errors import SolverError
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices
from isotruss_ros.core.numerics.tolerances import COINCIDENCE, EPSILON, ROUNDING, SMALLEST_NORMAL
import numpy as np
import scipy
from scipy.linalg import cholesky, lapack, lstsq, solve_triangular

#: Largest duality gap relative to |y|^2 [-]. It is also the tolerance of the inequalities relative
#: to the largest coefficient times 1 + |x|, if `ROUNDING` is not reached because active
#: constraints are nearly dependent.
LOOSE_TOLERANCE = 1e-8
#: Perturbations of the bounds relative to the size of the solution [-]. They are tried one after
#: another at degenerate vertices, where rounding disturbs the search.
BOUND_PERTURBATIONS = (0.0, 1e-12, 1e-11, 1e-10, 1e-9)


class QuadraticProgram(NamedTuple):
    """Strictly convex quadratic program in dimensionless quantities."""

    hessian: Array  #: (n, n) matrix P, positive definite
    gradient: Array  #: (n,) vector q
    rows: Array  #: (l, n) matrix G
    bounds: Array  #: (l,) vector h; infinite entries do not bound
    equality: Array | None = None  #: (k, n) matrix A of full row rank; None: no equalities
    target: Array | None = None  #: (k,) vector b


def solve_qp(problem: QuadraticProgram) -> Array | None:
    """Return the minimiser x (n,); None if none is found, or if P is not positive definite."""
    bounded = problem.bounds < np.inf
    rows, bounds = problem.rows[bounded], problem.bounds[bounded]
    free, start = _free_space(problem)
    largest = np.abs(rows).max(initial=SMALLEST_NORMAL)
    if not free.shape[1]:  # LAPACK refuses empty matrices
        excess = (rows @ start - bounds).max(initial=0.0)
        return start if excess <= LOOSE_TOLERANCE * largest * (1.0 + np.abs(start).max()) else None
    curvature = free.T @ problem.hessian @ free
    # Scaled variables: P has penalties up to 1e8 beside costs of 1.
    scale = 1.0 / np.sqrt(np.maximum(curvature.diagonal(), SMALLEST_NORMAL))
    factor, failed = lapack.dpotrf(scale[:, None] * curvature * scale, lower=1)
    if failed:
        return None
    free = free * scale
    # y = L^T z + offset is zero at the unconstrained minimum.
    slope = free.T @ (problem.hessian @ start + problem.gradient)
    offset, _ = lapack.dtrtrs(factor, slope, lower=1)
    columns, _ = lapack.dtrtrs(factor, (rows @ free).T, lower=1)
    room = bounds - rows @ start + offset @ columns
    best: Array | None = None
    smallest = LOOSE_TOLERANCE
    for relaxation in BOUND_PERTURBATIONS:
        nearest = find_nearest(columns, room, np.sqrt(offset @ offset), relaxation)
        if nearest is None:
            continue
        solution, step, active = start, nearest.point - offset, nearest.active
        for _ in range(2):
            solution = solution + free @ lapack.dtrtrs(factor, step, lower=1, trans=1)[0]
            excess = (rows @ solution - bounds).max(initial=0.0)
            # Plain numbers: rows of zeros that cannot be fulfilled give infinity.
            violation = float(excess) / float(largest * (1.0 + np.abs(solution).max()))
            if violation <= smallest:
                best, smallest = solution, violation
            if violation <= ROUNDING:
                return solution
            if not len(active):
                break
            # Digits lost to an offset much longer than x are restored by the active constraints.
            shortfall = bounds[active] - rows[active] @ solution
            step = solve_least_squares(columns[:, active].T, shortfall)
    return best


def require_solution(solution: Array | None) -> Array:
    """Return the solution of a program that has one unless the configuration is singular."""
    if solution is None:
        raise SolverError(
            'a quadratic program of the rollers has no solution; '
            'the configuration is probably close to a singular one'
        )
    return solution


def _free_space(problem: QuadraticProgram) -> tuple[Array, Array]:
    """Return an orthonormal basis (n, f) of the equalities' null space, and one solution (n,)."""
    n, k = len(problem.gradient), 0 if problem.equality is None else len(problem.equality)
    if k == 0:
        return np.eye(n), np.zeros(n)
    packed, tau, _, _ = lapack.dgeqrf(np.asfortranarray(problem.equality.T))
    square = np.zeros((n, n), order='F')
    square[:, :k] = packed
    basis, _, _ = lapack.dorgqr(square, tau)
    start, _ = lapack.dtrtrs(packed[:k], problem.target, trans=1)
    return basis[:, k:], basis[:, :k] @ start


class Nearest(NamedTuple):
    """Point of a polyhedron nearest to the origin."""

    point: Array  #: (f,) point y
    active: Indices  #: (a,) indices of the active constraints


def find_nearest(columns: Array, room: Array, size: float, relaxation: float) -> Nearest | None:
    """
    Return the point y of the polyhedron y . column <= room nearest to the origin.

    The bounds are perturbed by `relaxation` times `size`. The result is None if the polyhedron is
    empty, or if the search fails because of rounding errors.
    """
    lengths = np.sqrt(np.einsum('fl,fl->l', columns, columns))
    lengths[lengths <= COINCIDENCE * lengths.max(initial=0.0)] = np.inf
    normals, bounds = columns / lengths, room / lengths
    excess = -bounds.min(initial=0.0)
    if excess <= relaxation * size:
        return Nearest(np.zeros(len(columns)), np.zeros(0, dtype=np.intp))
    size = max(size, excess)
    matrix = np.concatenate([normals, bounds[None] / size])
    if relaxation:
        golden = 0.5 * (5.0**0.5 - 1.0)
        matrix[-1] += relaxation * (1.0 + np.arange(len(bounds)) * golden % 1.0)
    corner = np.zeros(len(matrix))
    corner[-1] = -1.0
    try:
        weights, _ = scipy.optimize.nnls(matrix, corner, maxiter=1000)
    except RuntimeError:
        return None
    active = np.flatnonzero(weights)
    sum_of_weights = 1.0 + matrix[-1, active] @ weights[active]
    # The residual vanishes if constraints contradict each other. No constraint is active if the
    # perturbed polyhedron contains the origin.
    if not EPSILON < sum_of_weights <= 1.0 or not len(active):
        return None
    normals, bounds = normals[:, active], bounds[active]
    # The minimum-norm y at the active bounds is accurate also for constraints of very different
    # stiffness.
    point = solve_least_squares(normals.T, bounds)
    # Duality: with nonnegative multipliers |y|^2 exceeds the minimum by at most the gap.
    slack = np.abs(bounds - point @ normals)
    multipliers = weights[active] * (size / sum_of_weights)
    for _ in range(2):
        residual = point + normals @ multipliers
        if residual @ residual + 2.0 * multipliers @ slack <= LOOSE_TOLERANCE * size * size:
            return Nearest(point, active)
        multipliers = np.maximum(multipliers - solve_least_squares(normals, residual), 0.0)
    return None


def solve_least_squares(matrix: Array, right: Array) -> Array:
    """Return the minimum-norm least-squares solution of matrix x = right, by pivoted QR."""
    return lstsq(matrix, right, COINCIDENCE, check_finite=False, lapack_driver='gelsy')[0]


def solve_complementarity(compliance: Array, gaps: Array) -> tuple[Array, Flags]:
    """
    Solve the contact LCP f >= 0, g = gaps + compliance @ f >= 0, f g = 0, equations (6) and (8).

    The result is the forces (c,) [N], and the mask (c,) of the points with a force.
    """
    forces = np.zeros(len(gaps))
    if (gaps < 0.0).any():
        try:
            root = cholesky(compliance, check_finite=False)
            target = solve_triangular(root, -gaps, trans='T', check_finite=False)
            active = scipy.optimize.nnls(root, target, maxiter=100 + 20 * len(gaps))[0] > 0.0
        except (np.linalg.LinAlgError, RuntimeError) as error:
            raise SolverError(
                'the complementarity problem was not solved: its matrix must be positive definite'
            ) from error
        # With the compliance instead of its factor, the rounding errors are smaller.
        _, closing, _ = lapack.dposv(compliance[np.ix_(active, active)], -gaps[active])
        forces[active] = np.maximum(closing, 0.0)
    return forces, forces > 0.0
