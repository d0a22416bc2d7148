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
    """Kinematic constraints; the rows are those of tubes, modules, bisections and ground."""

    def __init__(self, topology: Topology) -> None:
        self._topology = topology
        m, n = topology.n_modules, len(topology.node_names)
        a, b, c, member_end = topology.joint, topology.b, topology.c, topology.end
        self.n_rows = 5 * m + len(topology.grounded)
        self.n_columns = 2 * n
        self._heads = np.concatenate([member_end, b, c, c])
        self._tails = np.concatenate([b, a, a, b])
        stretch = np.arange(4 * m)
        bend = 4 * m + np.arange(m)
        self._rows = np.concatenate([stretch, stretch, bend, bend, bend, bend, bend])
        bisection = [member_end, b, c, a, b[topology.previous]]
        self._nodes = np.concatenate([self._heads, self._tails, *bisection])
        self._ground_rows = 5 * m + np.arange(len(topology.grounded))
        self._places = self._rows * n + self._nodes
        self._sparse: csc_matrix | None = None
        if self.n_columns > MAX_DENSE_COORDINATES:
            # Sparsity pattern with indices of the nonzero entries as data.
            columns = np.stack([2 * self._nodes, 2 * self._nodes + 1], axis=1).ravel()
            rows = np.concatenate([np.repeat(self._rows, 2), self._ground_rows])
            columns = np.concatenate([columns, topology.grounded])
            order = np.arange(1, len(rows) + 1)  # from 1: a stored zero could be dropped
            pattern = coo_matrix((order, (rows, columns)), shape=(self.n_rows, self.n_columns))
            self._sparse = pattern.tocsc()

    def residual(self, points: Points, lengths: Array) -> Array:
        """Return residuals (5m + g,): lengths (4m,) of `spans` [m], (3) [rad], ground [m]."""
        stretched = self.spans(points)
        return np.concatenate(
            [
                np.abs(stretched) - lengths,
                self.bisection(stretched),
                points.view(np.float64)[self._topology.grounded] - self._topology.ground,
            ]
        )

    def bisection(self, stretched: Points) -> Array:
        """Return the difference of the two angles between rod and sides in (3) [rad]."""
        side, to_b, to_c, _ = stretched.reshape(4, -1)
        rod = (to_b + to_c).conj()
        turn = -side * side[self._topology.previous] * rod * rod
        return np.arctan2(turn.imag, turn.real)

    def spans(self, points: Points) -> Points:
        """Return vectors (4m,) along the members, then AB, AC and BC of the modules [m]."""
        return points.take(self._heads) - points.take(self._tails)

    def matrix(self, points: Points) -> Array | csc_matrix:
        """Return the Jacobian (5m + g, 2n) of the residual by nodes; sparse for a large robot."""
        values = self.gradients(points)
        if self._sparse is not None:
            data = np.concatenate([values.view(np.float64), np.ones(len(self._ground_rows))])
            pattern = self._sparse
            return csc_matrix(
                (data[pattern.data - 1], pattern.indices, pattern.indptr), shape=pattern.shape
            )
        gradients = np.zeros(self.n_rows * len(points), dtype=np.complex128)
        gradients[self._places] = values
        matrix = gradients.view(np.float64).reshape(self.n_rows, self.n_columns)
        matrix[self._ground_rows, self._topology.grounded] = 1.0
        return matrix

    def gradients(self, points: Points) -> Points:
        """
        Return the nonzero entries of the Jacobian (12), see `matrix`.

        Each entry is the gradient of one constraint by one node, x + iy: first the gradients of
        the 4m lengths (see `residual`) by the end nodes [-], then by the start nodes (the
        negatives of the first), and last the 5m gradients of the bisection rows [1/m].
        """
        m = self._topology.n_modules
        spans = self.spans(points).reshape(4, m)
        lengths = np.abs(spans)
        stretch = spans / lengths
        # Bisection rows depend on next C, own B and C (which also turn the rod), joint, previous
        # B.
        side, rod = 1j * stretch[0] / lengths[0], 2j / (spans[1] + spans[2]).conj()
        back = side[self._topology.previous]
        bend = side, -side - rod, back - rod, 2.0 * rod, -back
        along = stretch.ravel()
        return np.concatenate([along, -along, *bend])

    def second_derivative(self, points: Points, weights: Array, motions: Array) -> Array:
        """
        Return the gradients (2n, p) of p scalars weights^T J motion by the node coordinates.

        For changes a and b of a vector v between two nodes, the second derivatives are
        d2|v|[a, b] = (n . a) (n . b) / |v| and d2t[a, b] = -Im(a b / v^2), with the unit normal n
        and the direction angle t of v.
        """
        m = self._topology.n_modules
        stretched = self.spans(points)[:, None]
        nodes = np.ascontiguousarray(motions.T).view(np.complex128).T
        moved = nodes[self._heads] - nodes[self._tails]
        lengths = np.abs(stretched)
        across = 1j * stretched / lengths
        gradients = weights[: 4 * m] * ((across.conj() * moved).real / lengths) * across
        sides, arms, bisection = slice(m), slice(m, 3 * m), slice(4 * m, 5 * m)
        bend = weights[bisection]
        at_both_ends = bend + bend[self._topology.following]
        gradients[sides] += at_both_ends * (1j * moved[sides] / stretched[sides] ** 2).conj()
        rod = stretched[arms].reshape(2, m, 1).sum(axis=0)
        rod_moved = moved[arms].reshape(2, m, -1).sum(axis=0)
        turned = -2.0 * bend * (1j * rod_moved / rod**2).conj()
        gradients[arms] += np.concatenate([turned, turned])
        derivative = np.zeros_like(nodes)
        np.add.at(derivative, self._heads, gradients)
        np.subtract.at(derivative, self._tails, gradients)
        return np.ascontiguousarray(derivative.T).view(np.float64).T


def follow_branch(
    constraints: Constraints, points: Points, lengths: Array, factor: Factor | None = None
) -> Points | None:
    """
    Return the nodes for new lengths on the same branch; None if the step is too long.

    A tangent step (12) is the predictor, modified Newton steps are the corrector. The `factor` is
    that of the matrix at `points`.
    """
    # Largest residual [m, rad], not less than the rounding error of the coordinates.
    tolerance = max(COINCIDENCE, 64.0 * EPSILON * float(np.abs(points).max()))
    residual = constraints.residual(points, lengths)
    error = np.abs(residual).max()
    start, predictor = points, None
    for _ in range(MAX_NEWTON_ITERATIONS):
        if error <= tolerance:
            return points
        fresh = factor is None
        try:
            factor = factor or factorize(constraints.matrix(points))
        except np.linalg.LinAlgError:
            return None
        moved = points - factor.solve(residual).view(np.complex128)
        residual = constraints.residual(moved, lengths)
        previous, error = error, np.abs(residual).max()
        if not error < np.inf:
            return None
        if predictor is None:
            predictor = moved
        else:
            # A longer corrector may leave the branch.
            reach = 0.5 * np.abs(predictor - start).max()
            if np.abs(moved - predictor).max() > reach + tolerance:
                return None
        if fresh and error > previous:
            return None
        points = moved
        if error > MAX_REUSE_CONTRACTION * previous:
            factor = None
        elif error * error < MAX_REUSE_CONTRACTION**2 * tolerance * previous:
            # Steps with the same factor reduce the residual by the same ratio, so the next step
            # is the last.
            return points - factor.solve(residual).view(np.complex128)
    return points if error <= tolerance else None
