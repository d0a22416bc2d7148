# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Linear algebra of this package on one BLAS thread.

The matrices of a robot have some hundred rows. OpenBLAS distributes their products over all cores;
the busy waiting of its threads then takes longer than the product. The number of threads is a
setting of the process. It is set at the begin of a solve and restored at its end; in the meantime
it applies to all threads of the user. Other BLAS libraries are not changed.
"""

from __future__ import annotations

from collections.abc import Callable
import ctypes
import functools
import itertools
import threading
from typing import NamedTuple, ParamSpec, TypeVar

import numpy as np
from scipy.linalg import lapack

#: Prefixes and suffixes of OpenBLAS's functions, as built by Linux distributions, NumPy 1, SciPy
#: and NumPy 2.
PREFIXES, SUFFIXES = ('', 'scipy_'), ('', '64_')

P = ParamSpec('P')
R = TypeVar('R')


class Library(NamedTuple):
    """BLAS library whose number of threads can be set."""

    count: Callable[[], int]  # type: ignore[assignment]  #: returns the number of threads
    set_count: Callable[[int], None]  #: sets the number of threads


@functools.cache
def find_libraries() -> tuple[Library, ...]:
    """Return the OpenBLAS libraries that NumPy and SciPy have loaded."""
    found = {}
    for module in (np.linalg._umath_linalg, lapack._flapack):  # type: ignore[attr-defined]
        # Symbols are looked up in a library and in its dependencies. PyDLL keeps the interpreter's
        # lock: these calls are shorter than its release.
        library = ctypes.PyDLL(module.__file__)
        for prefix, suffix in itertools.product(PREFIXES, SUFFIXES):
            names = (f'{prefix}openblas_{act}_num_threads{suffix}' for act in ('get', 'set'))
            count, set_count = (getattr(library, name, None) for name in names)
            if count is not None and set_count is not None:
                set_count.restype = None
                address = ctypes.cast(set_count, ctypes.c_void_p).value
                found[address] = Library(count, set_count)
    return tuple(found.values())


class OneThread:
    """
    Context with one BLAS thread; of overlapping contexts, the last to end restores the number.

    :param libraries: the libraries.
    """

    def __init__(self, libraries: Callable[[], tuple[Library, ...]] = find_libraries) -> None:
        self._libraries = libraries
        self._lock = threading.Lock()
        self._users = 0
        self._before: list[tuple[Library, int]] = []

    def __enter__(self) -> None:
        """Set the number of threads to one."""
        with self._lock:
            self._users += 1
            if self._users > 1:
                return
            for library in self._libraries():
                count = library.count()
                if count > 1:
                    self._before.append((library, count))
                    library.set_count(1)

    def __exit__(self, *_: object) -> None:
        """Restore the number of threads."""
        with self._lock:
            self._users -= 1
            if self._users == 0:
                while self._before:
                    library, count = self._before.pop()
                    library.set_count(count)


ONE_THREAD = OneThread()


def single_threaded(function: Callable[P, R]) -> Callable[P, R]:
    """
    Return a function that runs with one BLAS thread.

    :param function: function to run.
    """

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        with ONE_THREAD:
            return function(*args, **kwargs)

    return call
