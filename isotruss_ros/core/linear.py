"""Factor a square matrix once, solve with it and with its transpose often."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

Array = NDArray[np.float64]


class Factor(Protocol):
    """A factored square matrix."""

    def solve(self, right: Array) -> Array:
        """Return x with A x = right."""

    def solve_transposed(self, right: Array) -> Array:
        """Return x with A^T x = right."""


class DenseFactor:
    """LU of a dense matrix; quicker than sparse up to some hundred rows."""

    def __init__(self, matrix: Array) -> None:
        # LAPACK wants columns first: the transpose of a C array is one without a copy.
        self._lu, self._pivots, info = lapack.dgetrf(matrix.T, overwrite_a=True)
        if info > 0:
            raise np.linalg.LinAlgError(f'singular: pivot {info} is zero')

    def solve(self, right: Array) -> Array:
        """Return x with A x = right."""
        return lapack.dgetrs(self._lu, self._pivots, right, trans=1)[0]

    def solve_transposed(self, right: Array) -> Array:
        """Return x with A^T x = right."""
        return lapack.dgetrs(self._lu, self._pivots, right, trans=0)[0]


class SparseFactor:
    """LU of a sparse matrix (SuperLU); minimum degree fills in less than its default order."""

    def __init__(self, matrix: csc_matrix) -> None:
        try:
            self._lu: Any = splu(matrix, permc_spec='MMD_ATA')
        except RuntimeError as error:
            raise np.linalg.LinAlgError(str(error)) from error

    def solve(self, right: Array) -> Array:
        """Return x with A x = right."""
        return self._lu.solve(right)

    def solve_transposed(self, right: Array) -> Array:
        """Return x with A^T x = right."""
        return self._lu.solve(right, trans='T')


def factorize(matrix: Array | csc_matrix) -> Factor:
    """
    Factor a matrix; a dense one is overwritten.

    :raises numpy.linalg.LinAlgError: the matrix is exactly singular.
    """
    return DenseFactor(matrix) if isinstance(matrix, np.ndarray) else SparseFactor(matrix)
