"""
How far a shape is from losing its rigidity: the smallest singular value of the matrix of (12).

The bisection rows are angles [1/m]; times the rod length h they are numbers like the others, which
are unit vectors. So scaled, the singular values do not change with the robot's size: a robot built
twice as large, modules included, has the same. What is called rigidity here is the smallest of
them over what it is at home: 1 at home, 0 where the robot with locked rollers is a mechanism.

There is no decomposition of the whole matrix: a few inverse iterations on a block of vectors with
the factor at hand, then one of the block. It is a block so that the one that matters is found
where singular values are close, or change places.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.robot import Robot
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Vectors in the block: the error falls by (s_1 / s_5)^2 in each iteration, typically to 1/20.
BLOCK = 4
#: Inverse iterations on the squared matrix; the decomposition of the block is another half.
ITERATIONS = 3
#: At home, once for each robot, from vectors that know nothing.
ITERATIONS_AT_HOME = 60


class Modes(NamedTuple):
    """
    The least rigid ways to move, least first.

    :ivar values: (p,) singular values over the smallest one at home.
    :ivar rows: (5m + g, p) left singular vectors: one number for each row of (12).
    :ivar nodes: (2n, p) right singular vectors: how the nodes move.
    """

    values: Array
    rows: Array
    nodes: Array


class ShapeRigidity:
    """
    Measures the rigidity of a robot's shapes.

    :param robot: the robot.
    """

    def __init__(self, robot: Robot) -> None:
        m = robot.layout.n_modules
        self._scale = np.ones((robot.constraints.n_rows, 1))
        bisection = slice(4 * m, 5 * m)
        self._scale[bisection] = robot.description.module.rod_length
        # Of the entries of the matrix, as `Constraints.gradients` lists them.
        self._weights = np.repeat([1.0, robot.description.module.rod_length], [8 * m, 5 * m])
        size = robot.constraints.n_columns
        noise = np.random.default_rng(0).standard_normal((size, min(BLOCK, size)))
        self._at_home = 1.0
        home = self._modes(robot.home, noise, ITERATIONS_AT_HOME)
        self._at_home = float(home.values[0])
        # Noise: a weakest motion that has nothing in common with those at home is found too.
        self._start = home.nodes + 0.3 * noise / np.sqrt(size)

    def modes(self, config: Configuration) -> Modes:
        """
        Return the least rigid ways to move in one configuration.

        :raises ConfigurationError: the matrix is exactly singular.
        """
        return self._modes(config, self._start, ITERATIONS)

    def change(self, config: Configuration, other: Configuration) -> float:
        """
        Return by how much the rigidity of two shapes can differ at most.

        No singular value changes by more than the norm of what is added to the matrix (Weyl), and
        the Frobenius norm is no smaller than the spectral one.
        """
        change = np.abs(config.gradients - other.gradients) * self._weights
        return math.sqrt(change @ change) / self._at_home

    def gradients(self, config: Configuration, modes: Modes) -> Array:
        """
        Return how the rigidity of each mode changes as nodes move: u^T dM v over home's.

        :param modes: in this configuration; all of them or the first ones.
        :return: (p, 2n) rows on the node velocities (x0, y0, x1, y1, ...) [1/m].
        """
        turning = config.robot.constraints.turning(
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
def shape_rigidity(robot: Robot) -> ShapeRigidity:
    """Return what measures the rigidity of a robot's shapes; made once for each robot."""
    return ShapeRigidity(robot)
