# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Factor a square matrix once, solve with it and with its transpose often."""

from __future__ import annotations

from typing import Any

from isotruss_ros.core.numerics.arrays import Array
import numpy as np
from scipy.linalg import lapack
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import LinearOperator, onenormest, splu


class DenseFactor:
    """
    LU of a dense matrix; quicker than sparse up to some hundred rows.

    :param matrix: (n, n), overwritten.
    """

    def __init__(self, matrix: Array) -> None:
        # LAPACK wants columns first: the transpose of a C array is one without a copy.
        self._lu, self._pivots, info = lapack.dgetrf(matrix.T, overwrite_a=True)
        if info > 0:
            raise np.linalg.LinAlgError(f'singular: pivot {info} is zero')

    def solve(self, right: Array) -> Array:
        """
        Return x with A x = right.

        :param right: (n,) or (n, k) right-hand sides.
        """
        return lapack.dgetrs(self._lu, self._pivots, right, trans=1)[0]

    def solve_transposed(self, right: Array) -> Array:
        """
        Return x with A^T x = right.

        :param right: (n,) or (n, k) right-hand sides.
        """
        return lapack.dgetrs(self._lu, self._pivots, right, trans=0)[0]

    def _condition(self, norm: float) -> float:
        """Return an estimate of the condition number by the 1-norm of the matrix."""
        # What was factored is the transpose, whose infinity norm that is.
        inverse, _ = lapack.dgecon(self._lu, norm, norm='I')
        return 1.0 / inverse if inverse > 0.0 else float('inf')


class SparseFactor:
    """
    LU of a sparse matrix (SuperLU); minimum degree fills in less than its default order.

    :param matrix: (n, n).
    """

    def __init__(self, matrix: csc_matrix) -> None:
        try:
            self._lu: Any = splu(matrix, permc_spec='MMD_ATA')
        except RuntimeError as error:
            raise np.linalg.LinAlgError(str(error)) from error

    def solve(self, right: Array) -> Array:
        """Return x with A x = right; see `DenseFactor.solve`."""
        return self._lu.solve(right)

    def solve_transposed(self, right: Array) -> Array:
        """Return x with A^T x = right; see `DenseFactor.solve_transposed`."""
        return self._lu.solve(right, trans='T')


#: A factored square matrix.
Factor = DenseFactor | SparseFactor


def factorize(matrix: Array | csc_matrix) -> Factor:
    """
    Factor a matrix; a dense one is overwritten.

    :param matrix: (n, n).
    :raises numpy.linalg.LinAlgError: the matrix is exactly singular.
    """
    return DenseFactor(matrix) if isinstance(matrix, np.ndarray) else SparseFactor(matrix)


def factorize_with_condition(matrix: Array | csc_matrix) -> tuple[Factor | None, float]:
    """
    Factor a matrix and estimate its condition number in the 1-norm; a dense one stays as it is.

    :param matrix: (n, n).
    :return: the factor, and the estimate; None and infinity if the matrix is exactly singular.
    """
    norm = float(np.abs(matrix).sum(axis=0).max())
    try:
        if isinstance(matrix, np.ndarray):
            dense = DenseFactor(matrix.copy())
            return dense, dense._condition(norm)
        factor = SparseFactor(matrix)
    except np.linalg.LinAlgError:
        return None, float('inf')
    inverse = LinearOperator(
        matrix.shape,
        matvec=factor.solve,
        rmatvec=factor.solve_transposed,
        matmat=factor.solve,
        rmatmat=factor.solve_transposed,
        dtype=np.float64,
    )
    # A pivot that is nearly zero overflows; that is an infinite condition number.
    with np.errstate(over='ignore', invalid='ignore'):
        condition = norm * float(onenormest(inverse))
    return factor, condition if np.isfinite(condition) else float('inf')
