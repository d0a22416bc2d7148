# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Factorisations of square matrices for repeated solves with the matrix and its transpose."""

from __future__ import annotations

import contextlib
from typing import Any

from isotruss_ros.core.numerics.arrays import Array
import numpy as np
from scipy.linalg import lapack
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu


class DenseFactor:
    """LU factors of a dense matrix, which is overwritten; fast up to some hundred rows."""

    def __init__(self, matrix: Array) -> None:
        # LAPACK is column-major: the transpose of a C array avoids a copy.
        self._lu, self._pivots, info = lapack.dgetrf(matrix.T, overwrite_a=True)
        if info > 0:
            raise np.linalg.LinAlgError(f'singular: pivot {info} is zero')

    def solve(self, right: Array, transposed: bool = False) -> Array:
        """Return x with A x = right, or A^T x = right, for right-hand sides (n,) or (n, k)."""
        return lapack.dgetrs(self._lu, self._pivots, right, trans=not transposed)[0]


class SparseFactor:
    """LU factorisation of a sparse matrix (SuperLU), with minimum-degree ordering."""

    def __init__(self, matrix: csc_matrix) -> None:
        self._matrix = matrix
        try:
            self._lu: Any = splu(matrix, permc_spec='MMD_ATA')
        except RuntimeError as error:
            raise np.linalg.LinAlgError(str(error)) from error

    def __reduce__(self) -> tuple[type[SparseFactor], tuple[csc_matrix]]:
        """Return the matrix for pickling, because SuperLU's factors cannot be pickled."""
        return SparseFactor, (self._matrix,)

    def solve(self, right: Array, transposed: bool = False) -> Array:
        """Return x with A x = right, or A^T x = right; see `DenseFactor.solve`."""
        return self._lu.solve(right, trans='T' if transposed else 'N')


#: Factorisation of a square matrix.
Factor = DenseFactor | SparseFactor


def factorize(matrix: Array | csc_matrix) -> Factor:
    """Return the LU factors of a matrix (n, n); a dense matrix is overwritten."""
    return DenseFactor(matrix) if isinstance(matrix, np.ndarray) else SparseFactor(matrix)


def solve_each(matrices: Array, right: Array) -> Array:
    """
    Return the solutions (..., n, c) of linear equations with right-hand sides (..., n, c).

    Several matrices (..., n, n) are independent: if one is singular, its solution is NaN. One
    singular matrix alone raises LinAlgError.
    """
    size, columns = right.shape[-2:]
    if not right.size:
        return np.zeros(right.shape)
    if matrices.size == size * size:  # for one matrix, LAPACK takes half of the time of NumPy
        matrix, one_right = matrices.reshape(size, size), right.reshape(size, columns)
        _, _, solution, singular = lapack.dgesv(matrix, one_right)
        if not singular:
            return solution.reshape(right.shape)
        if matrices.ndim == 2:
            raise np.linalg.LinAlgError(f'singular: pivot {singular} is zero')
        return np.full(right.shape, np.nan)
    with contextlib.suppress(np.linalg.LinAlgError):
        return np.linalg.solve(matrices, right)
    solutions = np.full(right.shape, np.nan)
    for i, (matrix, of_matrix) in enumerate(zip(matrices, right, strict=True)):
        with contextlib.suppress(np.linalg.LinAlgError):
            solutions[i] = solve_each(matrix, of_matrix)
    return solutions


def estimate_condition(matrix: Array | csc_matrix) -> float:
    """Return a lower bound of the condition number in the maximum norm; infinite if singular."""
    # The solution for a probe of maximum norm 1 has at most the norm of the inverse. The numbers
    # have no pattern, so the probe is unlikely to be orthogonal to the largest singular direction.
    probe = np.cos(np.arange(matrix.shape[0]) ** 2)
    try:
        with np.errstate(over='ignore', invalid='ignore'):
            inverse_norm = float(np.abs(factorize(matrix.copy()).solve(probe)).max())
    except np.linalg.LinAlgError:
        return np.inf
    norm = float(np.abs(matrix).sum(axis=1).max())  # largest sum of a row
    return norm * inverse_norm if inverse_norm < np.inf else np.inf


def count_negative_pivots(matrix: Array | csc_matrix) -> int:
    """Return the number of negative eigenvalues of a symmetric matrix, from its LDL^T pivots."""
    dense = matrix if isinstance(matrix, np.ndarray) else matrix.toarray()
    factors, pivots, _ = lapack.dsytrf(dense, lower=True)
    # Pivots are single numbers or blocks of two rows; a block has one negative eigenvalue.
    is_single = pivots > 0
    negative = (factors.diagonal() < 0.0) & is_single
    return int(np.count_nonzero(negative)) + int(np.count_nonzero(~is_single)) // 2
