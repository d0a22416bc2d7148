# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Restriction of this package's linear algebra to one BLAS thread.

The matrices of a robot have some hundred rows. OpenBLAS distributes their products over all cores;
the busy waiting of its threads then takes longer than the product. The number of threads is a
setting of the process. It is set at the beginning of a computation and restored at its end; in the
meantime it applies to all threads of the user's process. Of computations at the same time, the
first one restores it. Other BLAS libraries are not changed.
"""

from __future__ import annotations

from collections.abc import Callable
import ctypes
import functools
import itertools
from typing import ParamSpec, TypeVar

import numpy as np
from scipy.linalg import lapack

#: Prefixes and suffixes of OpenBLAS's functions, as built by Linux distributions, NumPy 1, SciPy
#: and NumPy 2.
PREFIXES, SUFFIXES = ('', 'scipy_'), ('', '64_')

P = ParamSpec('P')
R = TypeVar('R')


@functools.cache
def _find_libraries() -> list[tuple[Callable[[], int], Callable[[int], None]]]:
    """Return functions that get and set the number of threads of each loaded OpenBLAS library."""
    libraries = {}
    for module in (np.linalg._umath_linalg, lapack._flapack):  # type: ignore[attr-defined]
        # Symbols are looked up in a library and in its dependencies. PyDLL keeps the interpreter's
        # lock, because releasing the lock takes longer than these calls.
        library = ctypes.PyDLL(module.__file__)
        for prefix, suffix in itertools.product(PREFIXES, SUFFIXES):
            get_count = getattr(library, f'{prefix}openblas_get_num_threads{suffix}', None)
            set_count = getattr(library, f'{prefix}openblas_set_num_threads{suffix}', None)
            if get_count is not None and set_count is not None:
                set_count.restype = None
                # Both modules may have the same library, at one address.
                address = ctypes.cast(set_count, ctypes.c_void_p).value
                libraries[address] = get_count, set_count
    return list(libraries.values())


def single_threaded(function: Callable[P, R]) -> Callable[P, R]:
    """Return a decorated function that runs with one BLAS thread."""

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        multithreaded = [
            (set_count, count)
            for get_count, set_count in _find_libraries()
            if (count := get_count()) > 1
        ]
        for set_count, _ in multithreaded:
            set_count(1)
        try:
            return function(*args, **kwargs)
        finally:
            for set_count, count in multithreaded:
                set_count(count)

    return call
