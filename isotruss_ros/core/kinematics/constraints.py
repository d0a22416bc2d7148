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
from isotruss_ros.core.numerics.arrays import Array, Points
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
    """Constraints on 4m lengths of members and modules, m bisections and g fixed coordinates."""

    def __init__(self, topology: Topology) -> None:
        self._topology = topology
        m, n = topology.n_modules, len(topology.node_names)
        a, b, c = topology.joint, topology.b, topology.c
        self.n_rows = 5 * m + len(topology.grounded)
        self.n_columns = 2 * n
        # End and start nodes of the spans: members, AB, AC and BC.
        self._heads = np.concatenate([topology.end, b, c, c])
        self._tails = np.concatenate([b, a, a, b])
        # Row and node of each entry of `gradients`.
        length_rows = np.arange(4 * m)
        bisection_rows = 4 * m + np.arange(m)
        rows = np.concatenate([length_rows, length_rows, *5 * [bisection_rows]])
        bisection_nodes = [topology.end, b, c, a, b[topology.previous]]
        nodes = np.concatenate([self._heads, self._tails, *bisection_nodes])
        self._flat_indices = rows * n + nodes
        self._ground_rows = 5 * m + np.arange(len(topology.grounded))
        self._pattern: csc_matrix | None = None
        if self.n_columns > MAX_DENSE_COORDINATES:
            # The data of the sparsity pattern are the numbers of the entries, see `matrix`.
            columns = np.stack([2 * nodes, 2 * nodes + 1], axis=1).ravel()
            all_rows = np.concatenate([np.repeat(rows, 2), self._ground_rows])
            all_columns = np.concatenate([columns, topology.grounded])
            numbers = np.arange(1, len(all_rows) + 1)  # from 1: a stored zero could be dropped
            shape = (self.n_rows, self.n_columns)
            self._pattern = coo_matrix((numbers, (all_rows, all_columns)), shape=shape).tocsc()

    def residual(self, points: Points, lengths: Array) -> Array:
        """Return errors (5m + g,) of lengths (4m,) [m], bisections [rad], coordinates [m]."""
        spans = self.spans(points)
        support_errors = points.view(np.float64)[self._topology.grounded] - self._topology.ground
        return np.concatenate([np.abs(spans) - lengths, self.bisection(spans), support_errors])

    def bisection(self, spans: Points) -> Array:
        """Return the rod's angle (m,) from one side minus that from the other, by (3) [rad]."""
        side, to_b, to_c, _ = spans.reshape(4, -1)
        rod = to_b + to_c
        # The previous side ends at the module, so the directions are `side` and -previous_side.
        previous_side = side[self._topology.previous]
        turn = -side * previous_side * rod.conj() ** 2
        return np.arctan2(turn.imag, turn.real)

    def spans(self, points: Points) -> Points:
        """Return the vectors (4m,) of the members, then AB, AC and BC of the modules [m]."""
        return points.take(self._heads) - points.take(self._tails)

    def matrix(self, points: Points) -> Array | csc_matrix:
        """Return the Jacobian (5m + g, 2n) of `residual` by nodes; sparse for a large robot."""
        gradients = self.gradients(points)
        if self._pattern is not None:
            entries = np.concatenate([gradients.view(np.float64), np.ones(len(self._ground_rows))])
            pattern = self._pattern
            return csc_matrix(
                (entries[pattern.data - 1], pattern.indices, pattern.indptr), shape=pattern.shape
            )
        # A complex entry for each row and node; its parts are the columns of x and y.
        complex_matrix = np.zeros(self.n_rows * len(points), dtype=np.complex128)
        complex_matrix[self._flat_indices] = gradients
        matrix = complex_matrix.view(np.float64).reshape(self.n_rows, self.n_columns)
        matrix[self._ground_rows, self._topology.grounded] = 1.0
        return matrix

    def gradients(self, points: Points) -> Points:
        """
        Return the nonzero entries of the Jacobian (12), see `matrix`.

        Each entry is the gradient of one constraint by one node, x + iy: first the gradients of
        the 4m lengths of `spans` by their end nodes [-], then by their start nodes, and last those
        of the m bisections by the next C, own B, own C, joint A and previous B [1/m].
        """
        m = self._topology.n_modules
        spans = self.spans(points).reshape(4, m)
        lengths = np.abs(spans)
        directions = spans / lengths
        # Gradients of angles: of the two sides by their ends, and of the rod, whose angle counts
        # twice in a bisection, by B or C; AB + AC is twice the rod.
        side = 1j * directions[0] / lengths[0]
        previous_side = side[self._topology.previous]
        rod = 2j / (spans[1] + spans[2]).conj()
        bisections = side, -side - rod, previous_side - rod, 2.0 * rod, -previous_side
        by_ends = directions.ravel()
        return np.concatenate([by_ends, -by_ends, *bisections])

    def second_derivative(self, points: Points, weights: Array, motions: Array) -> Array:
        """
        Return the gradients (2n, p) of p scalars weights^T J motion by the node coordinates.

        J is the Jacobian (5m + g, 2n) of (12), weights are (5m + g, p) and motions (2n, p). For
        changes a and b of a vector v between two nodes, the second derivatives are d2|v|[a, b] =
        (n . a) (n . b) / |v| and d2t[a, b] = -Im(a b / v^2), with the unit normal n and the
        direction angle t of v.
        """
        m = self._topology.n_modules
        members, rod_sides, bisections = slice(m), slice(m, 3 * m), slice(4 * m, 5 * m)
        # Complex arrays: vectors (4m, 1), motions of nodes (n, p) and changes of vectors (4m, p).
        spans = self.spans(points)[:, None]
        node_motions = np.ascontiguousarray(motions.T).view(np.complex128).T
        changes = node_motions[self._heads] - node_motions[self._tails]
        lengths = np.abs(spans)
        normals = 1j * spans / lengths
        # Gradients (4m, p) by the vectors, first of their lengths, then of the bisections: the
        # angle of a member is in the bisections at both of its ends.
        gradients = weights[: 4 * m] * ((normals.conj() * changes).real / lengths) * normals
        angle_weights = weights[bisections]
        member_weights = angle_weights + angle_weights[self._topology.following]
        gradients[members] += member_weights * (1j * changes[members] / spans[members] ** 2).conj()
        # Twice the rod is AB + AC, and its angle counts twice.
        rods = spans[rod_sides].reshape(2, m, 1).sum(axis=0)
        rod_changes = changes[rod_sides].reshape(2, m, -1).sum(axis=0)
        rod_gradients = -2.0 * angle_weights * (1j * rod_changes / rods**2).conj()
        gradients[rod_sides] += np.concatenate([rod_gradients, rod_gradients])
        by_nodes = np.zeros_like(node_motions)
        np.add.at(by_nodes, self._heads, gradients)
        np.subtract.at(by_nodes, self._tails, gradients)
        return np.ascontiguousarray(by_nodes.T).view(np.float64).T


def follow_branch(
    constraints: Constraints, points: Points, lengths: Array, factor: Factor | None = None
) -> Points | None:
    """
    Return the nodes at new lengths on the same branch of solutions; None if the step is too long.

    A tangent step (12) is the predictor, modified Newton steps are the corrector. The `factor` is
    that of the matrix at `points`.
    """
    # Largest residual [m, rad], not less than the rounding error of the coordinates.
    tolerance = max(COINCIDENCE, 64.0 * EPSILON * float(np.abs(points).max()))
    residual = constraints.residual(points, lengths)
    error = np.abs(residual).max()
    predictor, max_correction = None, np.inf
    for _ in range(MAX_NEWTON_ITERATIONS):
        if error <= tolerance:
            return points
        is_full_newton = factor is None
        try:
            factor = factor or factorize(constraints.matrix(points))
        except np.linalg.LinAlgError:
            return None
        moved = points - factor.solve(residual).view(np.complex128)
        residual = constraints.residual(moved, lengths)
        previous_error, error = error, np.abs(residual).max()
        if not error < np.inf or (is_full_newton and error > previous_error):
            return None
        if predictor is None:
            predictor = moved
            max_correction = 0.5 * np.abs(moved - points).max() + tolerance
        elif np.abs(moved - predictor).max() > max_correction:  # it may leave the branch
            return None
        points = moved
        contraction = error / previous_error
        if contraction > MAX_REUSE_CONTRACTION:
            factor = None
        elif contraction * error < MAX_REUSE_CONTRACTION**2 * tolerance:
            # A step with the same factor multiplies the residual by the same contraction, so the
            # next step is the last.
            return points - factor.solve(residual).view(np.complex128)
    return points if error <= tolerance else None
