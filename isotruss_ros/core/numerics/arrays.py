# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Conversion of input to checked arrays of finite numbers, and of points to coordinates."""

from __future__ import annotations

from collections.abc import Sized
import functools

from isotruss_ros.core.errors import IsotrussError
from isotruss_ros.core.numerics.tolerances import ROUNDING
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Points = NDArray[np.complex128]
Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]
#: Largest finite number of double precision [-].
LARGEST_NUMBER = float(np.finfo(float).max)
#: Largest magnitude of a number from outside, in SI units; its inverse is the smallest positive
#: number. Numbers out of this range are mistakes, and products of such numbers overflow.
MAX_MAGNITUDE = 1e12
#: Largest magnitude of a force [N] and of a moment [N m]. The tubes fail under a few kN; larger
#: loads are mistakes, or come from a broken sensor.
MAX_LOAD = 1e6
#: Largest number of entries of a list, and of characters of a text, from outside [-]; longer input
#: is a mistake. Python does not convert integers of several thousand digits to text.
MAX_ENTRIES = 1000


def finite_array(
    values: ArrayLike,
    size: int | tuple[int, ...],
    what: str,
    error: type[IsotrussError],
    most: float = LARGEST_NUMBER,
) -> NDArray[np.float64]:
    """Return a copy of finite numbers of magnitudes up to `most` as an array of this size."""
    shape = (size,) if isinstance(size, int) else size
    try:
        array = np.asarray(values)
    except ValueError:  # lists of different lengths
        array = np.asarray(None)  # without numbers, so it is refused
    # An empty list has one dimension only.
    if 0 in shape and array.size == 0:
        return np.zeros(shape)
    if array.dtype.kind in 'iuf' and array.shape == shape:
        # Before the comparison, since NumPy 2 rounds the bound to the type of the array.
        numbers = array.astype(np.float64)
        if (np.abs(numbers) <= most).all():
            return numbers
    # Message with the refused value, truncated, and the valid form.
    text = repr(values.tolist() if hasattr(values, 'tolist') else values)
    shown = text if len(text) <= 80 else text[:77] + '...'
    form = ' x '.join(map(str, shape)) + ' finite numbers'
    if shape == (1,):  # callers put a single number into a list
        shown = shown.removeprefix('[').removesuffix(']')
        form = 'a finite number'
    bound = '' if most == LARGEST_NUMBER else f', at most {most:g}'
    raise error(f'{what}: {shown}: must be {form}{bound}')


@functools.lru_cache(maxsize=16)
def identity(size: int) -> NDArray[np.float64]:
    """Return the identity matrix (size, size), cached and read-only."""
    matrix = np.eye(size)
    matrix.flags.writeable = False
    return matrix


def check_count(value: int, what: str, error: type[IsotrussError]) -> int:
    """Return a checked integer; raise an error if it is not an integer or negative."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 0:
        raise error(f'{what} {value!r}: must be an integer, not negative')
    return int(value)


def finite_rows(
    values: ArrayLike,
    columns: int,
    what: str,
    error: type[IsotrussError],
    most: float = LARGEST_NUMBER,
) -> NDArray[np.float64]:
    """Return a copy of rows of finite numbers of magnitudes up to `most`, (n, columns)."""
    if hasattr(values, 'shape'):
        rows = np.shape(values)[:1]
    else:
        rows = (len(values),) if isinstance(values, Sized) else ()
    return finite_array(values, (*rows, columns), what, error, most)


def covariance_matrix(
    values: ArrayLike, count: int, what: str, error: type[IsotrussError]
) -> NDArray[np.float64]:
    """Return a copy of a covariance matrix (count, count), checked to be semidefinite."""
    matrix = finite_array(values, (count, count), what, error)
    bound = ROUNDING * np.abs(matrix).max()
    symmetric = (np.abs(matrix - matrix.T) <= bound).all()
    if not symmetric or np.linalg.eigvalsh(matrix)[0] < -bound:
        raise error(f'{what}: must be symmetric and positive semidefinite')
    return matrix


def as_xy(vectors: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return vectors (c,) x + iy as an array (c, 2) of x and y."""
    return np.ascontiguousarray(vectors).view(np.float64).reshape(-1, 2)
