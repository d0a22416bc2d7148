# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arrays at the borders: numbers that callers hand over, and points as pairs of numbers."""

from __future__ import annotations

from isotruss_ros.core.errors import IsotrussError
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Points = NDArray[np.complex128]
Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]


def finite_array(
    values: ArrayLike, count: int, what: str, error: type[IsotrussError]
) -> NDArray[np.float64]:
    """
    Return a copy of `count` finite real numbers as an array (count,).

    :param values: the numbers.
    :param count: how many there must be.
    :param what: what the numbers are, for the message.
    :param error: the exception to raise.
    :raises IsotrussError: of the given class; names what was given and what would be right.
    """
    try:
        array = np.asarray(values)
    except ValueError:
        # Lists of different lengths.
        array = np.asarray(None)
    fits = array.dtype.kind in 'iuf' and array.shape == (count,) and np.isfinite(array).all()
    if not fits:
        given = repr(values)
        given = given if len(given) <= 80 else given[:77] + '...'
        raise error(f'{what}: {given}: must be {count} finite numbers')
    return array.astype(np.float64)


def as_xy(vectors: NDArray[np.complex128]) -> NDArray[np.float64]:
    """
    Turn vectors x + iy, (c,), into an array of x and y, (c, 2).

    :param vectors: (c,) x + iy.
    """
    return np.ascontiguousarray(vectors).view(np.float64).reshape(-1, 2)
