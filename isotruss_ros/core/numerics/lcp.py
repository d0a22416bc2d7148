# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Linear complementarity: where contact is, and how hard, by principal pivoting, equation (8)."""

from __future__ import annotations

from isotruss_ros.core.errors import SolverError
from isotruss_ros.core.numerics.arrays import Array, Flags
import numpy as np
import scipy
from scipy.linalg import cholesky, lapack, solve_triangular

#: Gaps and complementarity hold to this [m]; forces to this over the stiffest point's compliance.
GAP_TOLERANCE = 1e-9
#: Exchanges of many points at once without fewer wrong ones, before least squares.
MAX_BLOCK_EXCHANGES = 10


def solve_complementarity(compliance: Array, gaps: Array, active: Flags) -> tuple[Array, Flags]:
    """
    Find forces f >= 0 with g = gaps + compliance @ f >= 0 and f g = 0, equations (6) and (8).

    By exchanging all points that are wrong at once (Judice and Pires, 1994), which takes a few
    steps or goes in circles; then by nonnegative least squares.

    :param compliance: (c, c) symmetric positive definite [m/N].
    :param gaps: (c,) without forces [m].
    :param active: (c,) a guess of where the contact is.
    :return: forces (c,) [N] and where they act.
    :raises SolverError: the matrix is not positive definite.
    """
    active = active.copy()
    best, progress_timeout = len(gaps) + 1, MAX_BLOCK_EXCHANGES
    while True:
        forces = np.zeros(len(gaps))
        forces[active] = _closing(compliance, gaps, active)
        left = gaps + compliance @ forces
        wrong = (active & (forces < 0.0)) | (~active & (left < -0.1 * GAP_TOLERANCE))
        count = int(wrong.sum())
        if count == 0:
            return forces, active
        if count < best:
            best, progress_timeout = count, MAX_BLOCK_EXCHANGES
        elif progress_timeout == 0:
            return _by_least_squares(compliance, gaps)
        progress_timeout -= 1
        active ^= wrong


def _by_least_squares(compliance: Array, gaps: Array) -> tuple[Array, Flags]:
    """Do the same with W = R^T R: 1/2 f W f + f g is 1/2 |R f + R^-T g|^2 but for a constant."""
    try:
        root = cholesky(compliance)
        target = solve_triangular(root, -gaps, trans='T')
        active = scipy.optimize.nnls(root, target, maxiter=100 + 20 * len(gaps))[0] > 0.0
    except (np.linalg.LinAlgError, RuntimeError) as error:
        raise SolverError('the complementarity problem was not solved') from error
    forces = np.zeros(len(gaps))
    forces[active] = np.maximum(_closing(compliance, gaps, active), 0.0)
    return forces, forces > 0.0


def _closing(compliance: Array, gaps: Array, active: Flags) -> Array:
    """Return the forces at the active points, of any sign, that close their gaps."""
    places = np.flatnonzero(active)
    if not len(places):
        return np.zeros(0)
    _, forces, failed = lapack.dposv(compliance[places[:, None], places], -gaps[places])
    if failed:
        raise SolverError('the contact compliance is not positive definite')
    return forces
