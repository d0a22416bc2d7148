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
from scipy.linalg import lapack, lstsq

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
    is_finite = problem.bounds < np.inf
    rows, bounds = problem.rows[is_finite], problem.bounds[is_finite]
    largest_coefficient = np.abs(rows).max(initial=SMALLEST_NORMAL)

    # Null-space method: x = particular + null_space @ z fulfils the equalities for every z.
    null_space, particular = _solve_equalities(problem)
    if not null_space.shape[1]:  # LAPACK refuses empty matrices
        violation = _relative_violation(particular, rows, bounds, largest_coefficient)
        return particular if violation <= LOOSE_TOLERANCE else None

    # Cholesky factor L of the reduced Hessian. Its diagonal is scaled to 1, because P has
    # penalties up to 1e8 beside costs of 1.
    reduced_hessian = null_space.T @ problem.hessian @ null_space
    scale = 1.0 / np.sqrt(np.maximum(reduced_hessian.diagonal(), SMALLEST_NORMAL))
    factor, failed = lapack.dpotrf(scale[:, None] * reduced_hessian * scale, lower=1)
    if failed:
        return None
    basis = null_space * scale

    # Least distance problem: y = L^T z + offset is zero at the minimum without inequalities, and
    # the inequalities become y . column <= room.
    reduced_gradient = basis.T @ (problem.hessian @ particular + problem.gradient)
    offset, _ = lapack.dtrtrs(factor, reduced_gradient, lower=1)
    columns, _ = lapack.dtrtrs(factor, (rows @ basis).T, lower=1)
    room = bounds - rows @ particular + offset @ columns

    best, best_violation = None, LOOSE_TOLERANCE
    for perturbation in BOUND_PERTURBATIONS:
        nearest = find_nearest(columns, room, np.sqrt(offset @ offset), perturbation)
        if nearest is None:
            continue
        y_step = nearest.point - offset  # L^T z
        x = particular + basis @ lapack.dtrtrs(factor, y_step, lower=1, trans=1)[0]
        violation = _relative_violation(x, rows, bounds, largest_coefficient)
        active = nearest.active
        if violation > ROUNDING and len(active):
            # An offset much longer than x costs digits. A step to the active constraints restores
            # them.
            y_step = solve_least_squares(columns[:, active].T, bounds[active] - rows[active] @ x)
            refined = x + basis @ lapack.dtrtrs(factor, y_step, lower=1, trans=1)[0]
            refined_violation = _relative_violation(refined, rows, bounds, largest_coefficient)
            if refined_violation <= violation:
                x, violation = refined, refined_violation
        if violation <= ROUNDING:
            return x
        if violation <= best_violation:
            best, best_violation = x, violation
    return best


def _relative_violation(x: Array, rows: Array, bounds: Array, coefficient: float) -> float:
    """Return the largest violation of G x <= h, relative to the largest terms of G x [-]."""
    excess = (rows @ x - bounds).max(initial=0.0)
    # Plain numbers: rows of zeros that cannot be fulfilled give infinity.
    return float(excess) / float(coefficient * (1.0 + np.abs(x).max(initial=0.0)))


def require_solution(solution: Array | None) -> Array:
    """Return a program's solution; raise SolverError if it is None (singular configuration)."""
    if solution is None:
        raise SolverError(
            'a quadratic program of the rollers has no solution; '
            'the configuration is probably close to a singular one'
        )
    return solution


def _solve_equalities(problem: QuadraticProgram) -> tuple[Array, Array]:
    """Return an orthonormal basis (n, f) of the null space of A, and a solution of A x = b."""
    n, k = len(problem.gradient), 0 if problem.equality is None else len(problem.equality)
    if k == 0:
        return np.eye(n), np.zeros(n)
    # A^T = Q R; the first k columns of Q span the rows of A, the others its null space.
    factors, reflections, _, _ = lapack.dgeqrf(np.asfortranarray(problem.equality.T))
    padded = np.zeros((n, n), order='F')
    padded[:, :k] = factors
    q, _, _ = lapack.dorgqr(padded, reflections)
    row_coordinates, _ = lapack.dtrtrs(factors[:k], problem.target, trans=1)
    return q[:, k:], q[:, :k] @ row_coordinates


class Nearest(NamedTuple):
    """Point of a polyhedron nearest to the origin."""

    point: Array  #: (f,) point y
    active: Indices  #: (a,) indices of the active constraints


def find_nearest(columns: Array, room: Array, size: float, perturbation: float) -> Nearest | None:
    """
    Return the point y of the polyhedron y . column <= room nearest to the origin.

    The bounds are perturbed by `perturbation` times `size`. The result is None if the polyhedron
    is empty, or if the search fails because of rounding errors.
    """
    # Planes in Hesse normal form.
    lengths = np.sqrt(np.einsum('fl,fl->l', columns, columns))
    lengths[lengths <= COINCIDENCE * lengths.max(initial=0.0)] = np.inf  # no bound
    normals, distances = columns / lengths, room / lengths
    violation_at_origin = -distances.min(initial=0.0)
    if violation_at_origin <= perturbation * size:
        return Nearest(np.zeros(len(columns)), np.zeros(0, dtype=np.intp))

    # Nonnegative least squares of Lawson and Hanson: the residual has the direction of
    # (-y, unit), and the weights are proportional to the multipliers of the planes.
    unit = max(size, violation_at_origin)
    matrix = np.concatenate([normals, distances[None] / unit])
    if perturbation:  # by a different amount for each bound
        golden = 0.5 * (5.0**0.5 - 1.0)
        matrix[-1] += perturbation * (1.0 + np.arange(len(distances)) * golden % 1.0)
    target = np.zeros(len(matrix))
    target[-1] = -1.0
    try:
        weights, _ = scipy.optimize.nnls(matrix, target, maxiter=1000)
    except RuntimeError:
        return None
    active = np.flatnonzero(weights)
    last_residual = 1.0 + matrix[-1, active] @ weights[active]
    # The residual vanishes if constraints contradict each other. No constraint is active if the
    # perturbed polyhedron contains the origin.
    if not EPSILON < last_residual <= 1.0 or not len(active):
        return None

    # The minimum-norm y on the active planes is accurate also for constraints of very different
    # stiffness.
    active_normals, active_distances = normals[:, active], distances[active]
    point = solve_least_squares(active_normals.T, active_distances)
    slacks = np.abs(active_distances - point @ active_normals)
    multipliers = weights[active] * (unit / last_residual)
    if not _is_optimal(point, active_normals, slacks, multipliers, unit):
        return None
    return Nearest(point, active)


def _is_optimal(
    point: Array, normals: Array, slacks: Array, multipliers: Array, size: float
) -> bool:
    """Return whether the duality gap of min |y|^2 is negligible, if need be after a correction."""
    for _ in range(2):
        # Stationarity of the Lagrangian: y + normals @ multipliers = 0. With nonnegative
        # multipliers, |y|^2 exceeds the minimum by at most the gap.
        gradient = point + normals @ multipliers
        gap = gradient @ gradient + 2.0 * multipliers @ slacks
        if gap <= LOOSE_TOLERANCE * size * size:
            return True
        correction = solve_least_squares(normals, gradient)
        multipliers = np.maximum(multipliers - correction, 0.0)
    return False


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
        # The LCP is the optimality condition of min |U f - target| with f >= 0, where U^T U is the
        # compliance and U^T target = -gaps.
        factor, failed = lapack.dpotrf(compliance)
        if failed:
            raise SolverError('the complementarity problem has no positive definite matrix')
        target, _ = lapack.dtrtrs(factor, -gaps, trans=1)
        try:
            active = scipy.optimize.nnls(factor, target, maxiter=100 + 20 * len(gaps))[0] > 0.0
        except RuntimeError as error:
            raise SolverError('the complementarity problem was not solved') from error
        # With the compliance instead of its factor, the rounding errors are smaller.
        _, active_forces, _ = lapack.dposv(compliance[np.ix_(active, active)], -gaps[active])
        forces[active] = np.maximum(active_forces, 0.0)
    return forces, forces > 0.0
