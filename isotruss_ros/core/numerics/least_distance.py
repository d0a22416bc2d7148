# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The point of a polyhedron that is nearest to the origin, by nonnegative least squares.

    minimize |y|  subject to  y . column <= room  for each column

Lawson and Hanson, Solving Least Squares Problems, 1974, chapter 23, problem LDP. An answer is
checked by duality, so that it is the nearest point or none.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array, Indices
import numpy as np
import scipy
from scipy.linalg import lapack

#: Columns shorter than this share of the longest constrain nothing.
PARALLEL = 1e-12
#: Of the search for the active constraints; it takes a few.
MAX_EXCHANGES = 1000
#: |y|^2 is at most so much above the least, against the square of the size.
GAP = 1e-8
EPSILON = float(np.finfo(float).eps)
GOLDEN_RATIO = 0.6180339887498949


class Nearest(NamedTuple):
    """
    The point of a polyhedron that is nearest to the origin.

    :ivar point: (f,) y.
    :ivar active: (a,) numbers of the constraints that keep it from the origin.
    """

    point: Array
    active: Indices


def find_nearest(columns: Array, room: Array, size: float, relaxation: float) -> Nearest | None:
    """
    Return the point of a polyhedron that is nearest to the origin.

    :param columns: (f, l) its planes' normals, of any lengths.
    :param room: (l,) what y . column may be.
    :param size: an estimate of |y|, not negative.
    :param relaxation: by which the search for the active constraints sets the bounds apart,
        against the size; 0 or small.
    :return: None where none was found: the constraints contradict each other, or rounding has
        misled the search.
    """
    lengths = np.sqrt(np.einsum('fl,fl->l', columns, columns))
    lengths[lengths <= PARALLEL * lengths.max(initial=0.0)] = np.inf
    normals, bounds = columns / lengths, room / lengths
    beyond = -bounds.min(initial=0.0)
    if beyond <= relaxation * size:
        return Nearest(np.zeros(len(columns)), np.zeros(0, dtype=np.intp))
    size = max(size, beyond)
    matrix = np.concatenate([-normals, -bounds[None] / size])
    if relaxation:
        matrix[-1] -= relaxation * (1.0 + np.arange(len(bounds)) * GOLDEN_RATIO % 1.0)
    corner = np.zeros(len(matrix))
    corner[-1] = 1.0
    try:
        weights, _ = scipy.optimize.nnls(matrix, corner, maxiter=MAX_EXCHANGES)
    except RuntimeError:
        return None
    active = np.flatnonzero(weights)
    left = 1.0 - matrix[-1, active] @ weights[active]
    # Nothing is left where constraints contradict, none is active where the relaxation put the
    # origin inside.
    if not EPSILON < left <= 1.0 or not len(active):
        return None
    normals, bounds = normals[:, active], bounds[active]
    # The shortest y at these bounds: directions of very different stiffness keep their digits.
    point = solve_least_squares(normals.T, bounds)
    # Duality: with multipliers that are not negative |y|^2 is at most the gap above the least.
    apart, multipliers = np.abs(bounds - point @ normals), weights[active] * (size / left)
    for _ in range(2):
        rest = point + normals @ multipliers
        if rest @ rest + 2.0 * multipliers @ apart <= GAP * size * size:
            return Nearest(point, active)
        multipliers = np.maximum(multipliers - solve_least_squares(normals, rest), 0.0)
    return None


def solve_least_squares(matrix: Array, right: Array) -> Array:
    """
    Return the shortest x with the least |matrix x - right|.

    In place of `numpy.linalg.lstsq(matrix, right, rcond=PARALLEL)`, without its singular values.

    :param matrix: (m, n), of any rank, m and n at least 1.
    :param right: (m,)
    """
    rows, columns = matrix.shape
    padded = np.zeros((max(rows, columns), 1))
    padded[:rows, 0] = right
    pivots = np.zeros(columns, dtype=np.intc)
    work = 16 * len(padded)
    return lapack.dgelsy(matrix, padded, pivots, PARALLEL, work)[1][:columns, 0]
