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
    """The p smallest singular values of the constraint Jacobian, ascending, with their vectors."""

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
        m = robot.topology.n_modules
        self._scale = np.ones((robot.constraints.n_rows, 1))
        bisection = slice(4 * m, 5 * m)
        rod = robot.description.module.rod_length
        self._scale[bisection] = rod
        size = robot.constraints.n_columns
        noise = np.random.default_rng(0).standard_normal((size, min(BLOCK_SIZE, size)))
        self._at_home, self._start = 1.0, noise
        # Iterations from random vectors, once for each robot.
        home = self.modes(robot.home, 60)
        self._at_home = float(home.values[0])
        self.weights = np.repeat([1.0, rod], [8 * m, 5 * m]) / self._at_home
        # Random components find weakest modes that are orthogonal to those at home.
        self._start = home.nodes + 0.3 * noise / np.sqrt(size)

    def modes(self, config: Configuration, iterations: int = ITERATIONS) -> Modes:
        """Return the smallest singular values and vectors of the Jacobian in a configuration."""
        factor, scale, basis = config.factor, self._scale, self._start
        for _ in range(iterations):
            # (M^T M)^-1 with M = scale * matrix.
            weak = factor.solve(basis, transposed=True) / scale
            basis = np.linalg.qr(factor.solve(weak / scale))[0]
        weak = factor.solve(basis, transposed=True) / scale
        rows, inverse, turned = np.linalg.svd(weak, full_matrices=False)
        return Modes(1.0 / (self._at_home * inverse), rows, basis @ turned.T)

    def gradients(self, config: Configuration, modes: Modes) -> Array:
        """
        Return the derivatives (p, 2n) of the scaled singular values by the nodes [1/m].

        They are u^T dM v / s_home with singular vectors u and v of the matrix M.
        """
        turning = config.robot.constraints.second_derivative(
            config.points, self._scale * modes.rows, modes.nodes
        )
        return turning.T / self._at_home


@functools.lru_cache(maxsize=16)
@single_threaded
def rigidity_index(robot: Robot) -> RigidityIndex:
    """Return the `RigidityIndex` of a robot, cached."""
    return RigidityIndex(robot)
