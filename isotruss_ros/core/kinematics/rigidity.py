# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How far a shape is from losing its rigidity: the smallest singular value of the matrix of (12).

The bisection rows are angles [1/m]; times the rod length h they are numbers like the others, which
are unit vectors. So scaled, the singular values do not change with the robot's size: a robot built
twice as large, modules included, has the same. The rigidity index is the smallest of them over
what it is at home: 1 at home, 0 where the robot with locked rollers is a mechanism.

There is no decomposition of the whole matrix: a few inverse iterations on a block of vectors with
the factor at hand, then one of the block. It is a block so that the smallest value is found
where singular values are close, or change places.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.blas_threads import single_threaded
import numpy as np

#: Vectors in the block: the error falls by (s_1 / s_5)^2 in each iteration, typically to 1/20.
BLOCK = 4
#: Inverse iterations on the squared matrix; the decomposition of the block is another half.
ITERATIONS = 3
#: At home, once for each robot, from random vectors.
ITERATIONS_AT_HOME = 60


class Modes(NamedTuple):
    """The least rigid modes of motion, least first."""

    values: Array  #: (p,) singular values over the smallest one at home
    rows: Array  #: (5m + g, p) left singular vectors: one number for each row of (12)
    nodes: Array  #: (2n, p) right singular vectors: how the nodes move


class RigidityIndex:
    """
    Measures the rigidity of a robot's shapes.

    :ivar weights: (13m,) of the entries of the matrix, as `Constraints.gradients` lists them: what
        is added to them changes no index by more than its norm in these weights (Weyl; the
        Frobenius norm is no smaller than the spectral one).
    :param robot: the robot; its shape at home has the index 1.
    """

    def __init__(self, robot: Robot) -> None:
        m = robot.topology.n_modules
        self._scale = np.ones((robot.constraints.n_rows, 1))
        bisection = slice(4 * m, 5 * m)
        self._scale[bisection] = robot.description.module.rod_length
        size = robot.constraints.n_columns
        noise = np.random.default_rng(0).standard_normal((size, min(BLOCK, size)))
        self._at_home = 1.0
        home = self._modes(robot.home, noise, ITERATIONS_AT_HOME)
        self._at_home = float(home.values[0])
        rod = robot.description.module.rod_length
        self.weights = np.repeat([1.0, rod], [8 * m, 5 * m]) / self._at_home
        # Noise: a weakest motion that has nothing in common with those at home is found too.
        self._start = home.nodes + 0.3 * noise / np.sqrt(size)

    def modes(self, config: Configuration) -> Modes:
        """
        Return the least rigid modes of motion in one configuration.

        :param config: where the robot is.
        :raises ConfigurationError: the matrix is exactly singular.
        """
        return self._modes(config, self._start, ITERATIONS)

    def gradients(self, config: Configuration, modes: Modes) -> Array:
        """
        Return how the rigidity of each mode changes as nodes move: u^T dM v over home's.

        :param config: where the robot is.
        :param modes: in this configuration; all of them or the first ones.
        :return: (p, 2n) rows on the node velocities (x0, y0, x1, y1, ...) [1/m].
        """
        turning = config.robot.constraints.second_derivative(
            config.points, self._scale * modes.rows, modes.nodes
        )
        return turning.T / self._at_home

    def _modes(self, config: Configuration, block: Array, iterations: int) -> Modes:
        factor, scale = config.factor, self._scale
        for _ in range(iterations):
            # (M^T M)^-1 with M = scale * matrix.
            block = factor.solve(factor.solve_transposed(block) / scale**2)
            block = (
                np.linalg.qr(block)[0] if iterations > ITERATIONS else block / np.abs(block).max()
            )
        basis = np.linalg.qr(block)[0]
        weak = factor.solve_transposed(basis) / scale
        rows, inverse, turned = np.linalg.svd(weak, full_matrices=False)
        return Modes(1.0 / (self._at_home * inverse), rows, basis @ turned.T)


@functools.lru_cache(maxsize=16)
@single_threaded
def rigidity_index(robot: Robot) -> RigidityIndex:
    """
    Return what measures the rigidity of a robot's shapes; made once for each robot.

    :param robot: the robot.
    """
    return RigidityIndex(robot)
