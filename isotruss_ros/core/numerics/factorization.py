# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Factorisations of square matrices for repeated solves with the matrix and its transpose."""

from __future__ import annotations

from typing import Any

from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.tolerances import NEGLIGIBLE_SHARE
import numpy as np
from scipy.linalg import lapack
from scipy.sparse import bmat, csc_matrix, identity
from scipy.sparse.linalg import LinearOperator, onenormest, splu


class DenseFactor:
    """LU factors of a dense matrix, which is overwritten; fast up to some hundred rows."""

    def __init__(self, matrix: Array) -> None:
        # LAPACK is column-major: the transpose of a C array avoids a copy.
        self._lu, self._pivots, info = lapack.dgetrf(matrix.T, overwrite_a=True)
        if info > 0:
            raise np.linalg.LinAlgError(f'singular: pivot {info} is zero')

    def solve(self, right: Array) -> Array:
        """Return x with A x = right, for right-hand sides (n,) or (n, k)."""
        return lapack.dgetrs(self._lu, self._pivots, right, trans=1)[0]

    def solve_transposed(self, right: Array) -> Array:
        """Return x with A^T x = right, for right-hand sides (n,) or (n, k)."""
        return lapack.dgetrs(self._lu, self._pivots, right, trans=0)[0]

    def _condition(self, norm: float) -> float:
        """Return an estimate of the condition number from the 1-norm of the matrix."""
        # The transpose was factored; its infinity norm is the 1-norm of the matrix.
        inverse, _ = lapack.dgecon(self._lu, norm, norm='I')
        return 1.0 / inverse if inverse > 0.0 else float('inf')


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

    def solve(self, right: Array) -> Array:
        """Return x with A x = right; see `DenseFactor.solve`."""
        return self._lu.solve(right)

    def solve_transposed(self, right: Array) -> Array:
        """Return x with A^T x = right; see `DenseFactor.solve_transposed`."""
        return self._lu.solve(right, trans='T')


#: Factorisation of a square matrix.
Factor = DenseFactor | SparseFactor


def factorize(matrix: Array | csc_matrix) -> Factor:
    """Factorise a matrix (n, n); a dense matrix is overwritten."""
    return DenseFactor(matrix) if isinstance(matrix, np.ndarray) else SparseFactor(matrix)


def factorize_with_condition(matrix: Array | csc_matrix) -> tuple[Factor | None, float]:
    """
    Factorise a matrix and estimate its condition number in the 1-norm; None, infinity: singular.

    A dense matrix is not overwritten.
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
    # A nearly zero pivot overflows: the condition number is infinite.
    with np.errstate(over='ignore', invalid='ignore'):
        condition = norm * float(onenormest(inverse))
    return factor, condition if np.isfinite(condition) else float('inf')


def count_negative_pivots(matrix: Array | csc_matrix, constraints: int) -> int:
    """Return the number of negative pivots of the factors L D L^T of a bordered stiffness."""
    if isinstance(matrix, np.ndarray):
        factors, pivots, _ = lapack.dsytrf(matrix, lower=True)
        # A block of two rows has one negative pivot.
        single = pivots > 0
        negative = (factors.diagonal() < 0.0) & single
        return int(np.count_nonzero(negative)) + int(np.count_nonzero(~single)) // 2
    # SuperLU exchanges no rows of a quasi-definite matrix. So the zero diagonal of the constraints
    # is replaced by a small negative one, and their penalty stiffness is added to the stiffness.
    rows = matrix[-constraints:, :-constraints] if constraints else matrix[:0]
    softened = NEGLIGIBLE_SHARE * identity(constraints, format='csc')
    stiff = matrix[: matrix.shape[0] - constraints, : matrix.shape[0] - constraints]
    blocks = [[stiff + rows.T @ rows / NEGLIGIBLE_SHARE**0.5, rows.T], [rows, -softened]]
    whole = bmat(blocks, format='csc') if constraints else matrix
    options = {'SymmetricMode': True}
    factor = splu(whole, permc_spec='MMD_AT_PLUS_A', diag_pivot_thresh=0.0, options=options)
    return int(np.count_nonzero(factor.U.diagonal() < 0.0))
