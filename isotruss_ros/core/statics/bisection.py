# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Bisection constraints (3) of a frame: the rod of a module bisects the angle of its guide arms.

With the joint A, the pinch points B and C and the guide rings D and E of a module, the rod is the
vector from A to the midpoint of BC, and the arms are BD and CE. The rod turns by the mean of the
rotations of both arms. Each constraint has a Lagrange multiplier.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array, Indices, Points
import numpy as np

#: Rod and arms of a module as combinations of its nodes A, B, C, D, E.
VECTORS = np.array([[-1.0, 0.5, 0.5, 0, 0], [0, -1.0, 0, 1.0, 0], [0, 0, -1.0, 0, 1.0]])
#: Factors of the rotations of rod and arms in a constraint.
WEIGHTS = np.array([2.0, -1.0, -1.0])
#: The combinations by nodes, and the products of their factors for pairs of nodes. They are
#: complex, because products of real and complex matrices take longer.
BY_NODES = VECTORS.T.astype(np.complex128)
BY_PAIRS = (VECTORS[:, :, None] * VECTORS[:, None]).reshape(3, -1).astype(np.complex128)


class Bisections(NamedTuple):
    """Bisection constraints of c modules."""

    nodes: Indices  #: (c, 5) indices of the nodes A, B, C, D, E

    @property
    def places(self) -> Indices:
        """Return the indices (c, 10) of the displacements ux, uy of the nodes among all (3 n,)."""
        return (3 * self.nodes[:, :, None] + [0, 1]).reshape(-1, 10)

    def slopes(self, points: Points, chosen: Indices) -> Array:
        """Return the derivatives (..., q, 10) of q chosen constraints, see `linearize`."""
        return _gradients(points.take(self.nodes[chosen], axis=-1) @ VECTORS.T)

    def linearize(
        self, points: Points, displacements: Array, multipliers: Array, chosen: Indices
    ) -> tuple[Array, Array, Array]:
        """
        Linearise q chosen constraints about displacements (..., n, 3) of nodes at points (..., n).

        The result is the derivatives (..., q, 10) by the displacements at `places`, the gaps (...,
        q) [rad], and the geometric stiffness (..., q, 10, 10) due to the multipliers (..., c).
        """
        nodes = self.nodes[chosen]
        vectors = points.take(nodes, axis=-1) @ BY_NODES
        shifts = displacements[..., 0] + 1j * displacements[..., 1]
        displaced = vectors + shifts.take(nodes, axis=-1) @ BY_NODES
        rotations = displaced * vectors.conj()
        gaps = np.arctan2(rotations.imag, rotations.real) @ WEIGHTS
        # With z = x + iy, the second derivatives xx, yy and xy of arg z are Im(-1/z^2), Im(1/z^2)
        # and Re(-1/z^2).
        curvatures = -WEIGHTS * multipliers[..., chosen, None] / displaced**2
        of_nodes = (curvatures @ BY_PAIRS).reshape(*gaps.shape, 5, 5)
        # Axes: sample, constraint, node, x or y, node, x or y.
        stiffness = np.empty((*gaps.shape, 5, 2, 5, 2))
        stiffness[..., 0, :, 0], stiffness[..., 1, :, 1] = of_nodes.imag, -of_nodes.imag
        stiffness[..., 0, :, 1] = stiffness[..., 1, :, 0] = of_nodes.real
        return _gradients(displaced), gaps, stiffness.reshape(*gaps.shape, 10, 10)


def _gradients(vectors: Points) -> Array:
    """Return derivatives (..., q, 10) of constraints by the nodes, for rods and arms (q, 3)."""
    # A gradient (d/dx, d/dy) of arg z is the complex number d/dx + i d/dy = i / conj(z).
    return np.ascontiguousarray((1j * WEIGHTS / vectors.conj()) @ VECTORS).view(np.float64)
