# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Kinematic constraints of the nodes and their Jacobian, the matrix of equation (12).

Points of the plane are complex numbers x + iy. For a vector v with direction angle t, d|v| =
Re(conj(e) dv) with e = v/|v|, and dt = Re(conj(g) dv) with g = i v/|v|^2. So each row of the
matrix consists of one complex gradient for each node in the constraint.
"""

from __future__ import annotations

from isotruss_ros.core.model.topology import Topology
from isotruss_ros.core.numerics.arrays import Array, Flags, Points
from isotruss_ros.core.numerics.factorization import Factor, factorize
from isotruss_ros.core.numerics.tolerances import COINCIDENCE, EPSILON, MAX_NEWTON_ITERATIONS
import numpy as np
from scipy.sparse import coo_matrix, csc_matrix

#: Largest number of coordinates with dense matrices [-]. Beyond it sparse factorisations are
#: faster (nested triangles of 9 to 303 modules).
MAX_DENSE_COORDINATES = 180
#: Largest ratio of successive residuals at which a factorisation is reused [-].
MAX_REUSE_CONTRACTION = 0.1


class Constraints:
    """Kinematic constraints: 4m lengths, m bisections (3) and g fixed coordinates."""

    def __init__(self, topology: Topology) -> None:
        self._topology = topology
        m, n = topology.n_modules, len(topology.node_names)
        a, b, c = topology.joint, topology.b, topology.c
        self.n_rows = 5 * m + len(topology.grounded)
        self.n_columns = 2 * n
        # End and start nodes of the spans: members, AB, AC and BC.
        self._heads = np.concatenate([topology.end, b, c, c])
        self._tails = np.concatenate([b, a, a, b])
        # Constraint (row of the matrix) and node of each entry of `gradients`.
        lengths, bisections = np.arange(4 * m), np.arange(4 * m, 5 * m)
        bisection_nodes = [topology.end, b, c, a, b[topology.previous]]
        rows = np.concatenate([lengths, lengths, *5 * [bisections]])
        nodes = np.concatenate([self._heads, self._tails, *bisection_nodes])
        # Places of the entries in a dense matrix with one complex column for each node, whose real
        # and imaginary parts are in the columns of x and y; and that matrix without the entries.
        self._flat_indices = rows * n + nodes
        self._ground_rows = np.arange(5 * m, self.n_rows)
        self._ground_matrix = np.zeros(self.n_rows * n, dtype=np.complex128)
        self._ground_matrix.view(np.float64)[
            self._ground_rows * self.n_columns + topology.grounded
        ] = 1.0
        # Sparsity pattern of the real matrix. Its data are the numbers of the entries: each
        # gradient's x and y, then the fixed coordinates.
        self._pattern: csc_matrix | None = None
        if self.n_columns > MAX_DENSE_COORDINATES:
            columns = np.stack([2 * nodes, 2 * nodes + 1], axis=1).ravel()
            all_rows = np.concatenate([np.repeat(rows, 2), self._ground_rows])
            all_columns = np.concatenate([columns, topology.grounded])
            numbers = np.arange(1, len(all_rows) + 1)  # from 1: a stored zero could be dropped
            shape = (self.n_rows, self.n_columns)
            self._pattern = coo_matrix((numbers, (all_rows, all_columns)), shape=shape).tocsc()

    def residual(self, points: Points, lengths: Array) -> Array:
        """Return the violations (..., 5m + g) of constraints for lengths (..., 4m) [m, rad]."""
        spans, coordinates = self.spans(points), points.view(np.float64)
        support_errors = coordinates.take(self._topology.grounded, -1) - self._topology.ground
        violations = np.abs(spans) - lengths, self.bisection(spans), support_errors
        return np.concatenate(violations, axis=-1)

    def bisection(self, spans: Points) -> Array:
        """Return the violations (..., m) of the bisection of sides by rods, by (3) [rad]."""
        member, to_b, to_c, _ = spans.reshape(*spans.shape[:-1], 4, -1).swapaxes(0, -2)
        rod = to_b + to_c
        # The angles of the module's member and of the previous one, which ends at the module and
        # so points to it, minus twice the angle of the rod.
        turn = member * -member.take(self._topology.previous, -1) * rod.conj() ** 2
        return np.arctan2(turn.imag, turn.real)

    def spans(self, points: Points) -> Points:
        """Return the vectors (..., 4m) of members, then AB, AC and BC of the modules [m]."""
        return points.take(self._heads, -1) - points.take(self._tails, -1)

    def matrix(self, points: Points) -> Array | csc_matrix:
        """Return the Jacobian (5m + g, 2n) of `residual` by nodes; sparse for a large robot."""
        gradients = self.gradients(points)
        pattern = self._pattern
        if pattern is not None:
            entries = np.concatenate([gradients.view(np.float64), np.ones(len(self._ground_rows))])
            data = entries[pattern.data - 1]
            return csc_matrix((data, pattern.indices, pattern.indptr), shape=pattern.shape)
        matrix = self._ground_matrix.copy()
        matrix[self._flat_indices] = gradients
        return matrix.view(np.float64).reshape(self.n_rows, self.n_columns)

    def gradients(self, points: Points) -> Points:
        """
        Return the nonzero entries of the Jacobian (12), see `matrix`.

        Each entry is the gradient of one constraint by one node, x + iy: first the gradients of
        the 4m lengths of `spans` by their end nodes [-], then by their start nodes, and last those
        of the m bisections by the next C, own B, own C, joint A and previous B [1/m].
        """
        spans = self.spans(points)
        by_ends = spans / np.abs(spans)
        # Gradients i v/|v|^2 = i/conj(v) of the angles of the members, and of the rods along
        # v = AB + AC, whose angles count twice in `bisection`.
        along_member, to_b, to_c, _ = spans.reshape(4, -1)
        member, rod = 1j / along_member.conj(), 2j / (to_b + to_c).conj()
        previous_member = member[self._topology.previous]
        bisections = member, -member - rod, previous_member - rod, 2.0 * rod, -previous_member
        return np.concatenate([by_ends, -by_ends, *bisections])

    def second_derivative(self, points: Points, weights: Array, motions: Array) -> Array:
        """
        Return the gradients (2n, p) of p scalars weights^T J motion by the node coordinates.

        J is the Jacobian (5m + g, 2n) of (12), weights are (5m + g, p) and motions (2n, p). If a
        vector v changes by dv, its length changes by d|v| and its direction angle by dt =
        Im(dv / v). Their gradients by v are (n . dv) n / |v|, with the unit normal n, and
        conj(i dv / v^2).
        """
        m = self._topology.n_modules
        members, ab, ac = slice(m), slice(m, 2 * m), slice(2 * m, 3 * m)
        length_weights, bisection_weights, _ = np.split(weights, [4 * m, 5 * m])
        # Complex vectors v (4m, 1) between nodes, and their changes (4m, p) by the motions.
        spans = self.spans(points)[:, None]
        node_motions = np.ascontiguousarray(motions.T).view(np.complex128).T
        changes = node_motions[self._heads] - node_motions[self._tails]
        # Lengths.
        lengths = np.abs(spans)
        normals = 1j * spans / lengths
        by_spans = length_weights * ((normals.conj() * changes).real / lengths) * normals
        # Bisections: the angle of each member counts at both of its ends, and that of each rod,
        # along AB + AC, twice with the opposite sign.
        member_weights = bisection_weights + bisection_weights[self._topology.following]
        angle_weights = np.concatenate([member_weights, -2.0 * bisection_weights])
        vectors = np.concatenate([spans[members], spans[ab] + spans[ac]])
        vector_changes = np.concatenate([changes[members], changes[ab] + changes[ac]])
        by_vectors = angle_weights * (1j * vector_changes / vectors**2).conj()
        by_spans[members] += by_vectors[:m]
        by_spans[ab] += by_vectors[m:]
        by_spans[ac] += by_vectors[m:]
        # Chain rule: a vector is its head minus its tail.
        by_nodes = np.zeros_like(node_motions)
        np.add.at(by_nodes, self._heads, by_spans)
        np.subtract.at(by_nodes, self._tails, by_spans)
        return np.ascontiguousarray(by_nodes.T).view(np.float64).T


def residual_tolerance(points: Points) -> float:
    """Return the largest residual [m, rad], not less than the rounding error of coordinates."""
    return max(COINCIDENCE, 64.0 * EPSILON * float(np.abs(points).max()))


def follow_branch(
    constraints: Constraints, points: Points, lengths: Array, factor: Factor | None = None
) -> Points | None:
    """
    Return the nodes at new lengths on the same branch of solutions; None if the step is too long.

    A tangent step (12) is the predictor, modified Newton steps are the corrector: they use the
    `factor` of the matrix at `points`, or at a later iterate if the residual decreases slowly.
    """
    tolerance = residual_tolerance(points)
    residual = constraints.residual(points, lengths)
    error = np.abs(residual).max()
    predictor = None
    for _ in range(MAX_NEWTON_ITERATIONS):
        if error <= tolerance:
            return points
        # Newton step.
        is_new_factor = factor is None
        try:
            factor = factor or factorize(constraints.matrix(points))
        except np.linalg.LinAlgError:
            return None
        moved = points - factor.solve(residual).view(np.complex128)
        residual = constraints.residual(moved, lengths)
        previous_error, error = error, np.abs(residual).max()

        # A divergent iteration, or a correction longer than half of the predictor's step, may
        # leave the branch.
        if not error < np.inf or (is_new_factor and error > previous_error):
            return None
        if predictor is None:
            predictor = moved
            max_correction = 0.5 * np.abs(moved - points).max() + tolerance
        elif np.abs(moved - predictor).max() > max_correction:
            return None
        points = moved

        # The next step with the same factor would multiply the residual by the same contraction.
        contraction = error / previous_error
        if contraction > MAX_REUSE_CONTRACTION:
            factor = None
        elif contraction * error < MAX_REUSE_CONTRACTION**2 * tolerance:  # it is the last step
            return points - factor.solve(residual).view(np.complex128)
    return points if error <= tolerance else None


def follow_branches(
    constraints: Constraints, points: Points, lengths: Array, factor: Factor
) -> tuple[Points, Flags]:
    """
    Return the nodes (n, .) at n new lengths (n, 4m), and for which of them they are found.

    The steps are those of `follow_branch` with the `factor` of the matrix at `points` alone. If
    this does not suffice, the nodes are not found.
    """
    tolerance = residual_tolerance(points)
    moved = np.tile(points, (len(lengths), 1))
    residual = constraints.residual(moved, lengths)
    error = np.abs(residual).max(axis=-1)
    predicted, max_correction = moved, np.full(len(lengths), np.inf)
    moves = error > tolerance
    is_valid = np.ones(len(lengths), dtype=bool)
    for number in range(MAX_NEWTON_ITERATIONS):
        if not moves.any():
            break
        steps = np.ascontiguousarray(factor.solve(residual.T).T).view(np.complex128)
        moved = np.where(moves[:, None], moved - steps, moved)
        residual = constraints.residual(moved, lengths)
        previous_error, error = error, np.abs(residual).max(axis=-1)
        if number == 0:
            predicted = moved
            max_correction = 0.5 * np.abs(moved - points).max(axis=-1) + tolerance
        is_near = np.abs(moved - predicted).max(axis=-1) <= max_correction
        converges = error <= MAX_REUSE_CONTRACTION * previous_error
        is_valid &= ~moves | (is_near & (converges | (error <= tolerance)))
        moves &= is_valid & (error > tolerance)
    return moved, is_valid & ~moves
