# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Rigidity index, which is the scaled smallest singular value of the matrix of (12).

The bisection rows [1/m] are multiplied by the rod length h. Then all rows are dimensionless, and
the singular values do not depend on the robot's size. The rigidity index is the smallest singular
value divided by the smallest at home: 1 at home, and 0 if the robot with locked rollers is a
mechanism.

The smallest singular values are found by inverse iteration with the factorised matrix, which is
faster than a singular value decomposition. Several vectors are iterated at once (block), so that
the smallest value is found even if singular values are close or change their order.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.blas_threads import single_threaded
import numpy as np

#: Number of vectors in the block [-]. With the singular values s_1 < s_2 < ..., each iteration
#: multiplies the error of s_1 by (s_1 / s_5)^2, typically 1/20.
BLOCK_SIZE = 4
#: Number of inverse iterations on M^T M [-]; the singular value decomposition of the block counts
#: as half an iteration.
ITERATIONS = 3


class Modes(NamedTuple):
    """The p smallest singular values of the scaled matrix of (12), ascending, with vectors."""

    values: Array  #: (p,) singular values, divided by the smallest one at home
    rows: Array  #: (5m + g, p) left singular vectors, one entry for each row of (12)
    nodes: Array  #: (2n, p) right singular vectors: node velocities


class RigidityIndex:
    """
    Rigidity index of a robot's configurations, 1 at home, with its gradients.

    :ivar weights: (13m,) weights for `Constraints.gradients`. The weighted norm of a change of the
        gradients is an upper bound of the change of the index (Weyl's inequality).
    """

    def __init__(self, robot: Robot) -> None:
        m, rod = robot.topology.n_modules, robot.description.module.rod_length
        self._row_scale = np.ones((robot.constraints.n_rows, 1))
        bisections = slice(4 * m, 5 * m)
        self._row_scale[bisections] = rod
        # The singular value at home, from random vectors and many iterations.
        size = robot.constraints.n_columns
        noise = np.random.default_rng(0).standard_normal((size, min(BLOCK_SIZE, size)))
        self._home_value, self._start_vectors = 1.0, noise
        home_modes = self.modes(robot.home, 60)
        self._home_value = float(home_modes.values[0])
        # Other configurations need few iterations from the modes at home. Random components
        # contribute modes that are orthogonal to these.
        self._start_vectors = home_modes.nodes + 0.3 * noise / np.sqrt(size)
        # Weights of the 8m gradients of lengths and the 5m gradients of bisections.
        self.weights = np.repeat([1.0, rod], [8 * m, 5 * m]) / self._home_value

    def modes(self, config: Configuration, iterations: int = ITERATIONS) -> Modes:
        """Return the smallest singular values and vectors of the matrix of (12), rows scaled."""
        factor, scale, vectors = config.factor, self._row_scale, self._start_vectors
        # Inverse iteration V <- qr(M^-1 M^-T V). The matrix is M = D A with the scale D of the
        # rows, so M^-T = D^-1 A^-T and M^-1 = A^-1 D^-1.
        for _ in range(iterations):
            solved = factor.solve(vectors, transposed=True) / scale
            vectors = np.linalg.qr(factor.solve(solved / scale))[0]
        # M^-T V = U S R^T, so M has the left vectors U, right vectors V R and values 1 / S.
        solved = factor.solve(vectors, transposed=True) / scale
        left_vectors, inverses, rotation = np.linalg.svd(solved, full_matrices=False)
        return Modes(1.0 / (self._home_value * inverses), left_vectors, vectors @ rotation.T)

    def gradients(self, config: Configuration, modes: Modes) -> Array:
        """
        Return the derivatives (p, 2n) of the scaled singular values by the nodes [1/m].

        They are u^T dM v / s_home with singular vectors u and v of the matrix M.
        """
        derivatives = config.robot.constraints.second_derivative(
            config.points, self._row_scale * modes.rows, modes.nodes
        )
        return derivatives.T / self._home_value


@functools.lru_cache(maxsize=16)
@single_threaded
def rigidity_index(robot: Robot) -> RigidityIndex:
    """Return the `RigidityIndex` of a robot, cached."""
    return RigidityIndex(robot)
