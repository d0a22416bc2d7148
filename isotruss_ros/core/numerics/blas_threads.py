# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
One thread for the linear algebra of this package, whatever the user's NumPy has.

The matrices of a robot have some hundred rows. OpenBLAS shares such a product among all cores, and
its threads wait for each other in busy loops: that takes longer than the product. The number of
threads is one number of the process, so it is set where a solve begins and set back where it ends;
other threads of the user that multiply matrices in the meantime have one thread too. Another BLAS
than OpenBLAS is left as it is.
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

#: OpenBLAS is built under these names: of Linux distributions, NumPy 1, SciPy, and NumPy 2.
PREFIXES, SUFFIXES = ('', 'scipy_'), ('', '64_')

P = ParamSpec('P')
R = TypeVar('R')


class Library(NamedTuple):
    """A BLAS library that has threads."""

    count: Callable[[], int]  # type: ignore[assignment]  #: returns the number of its threads
    set_count: Callable[[int], None]  #: sets it


@functools.cache
def find_libraries() -> tuple[Library, ...]:
    """Return the OpenBLAS libraries of NumPy and SciPy, which bring one each."""
    found = {}
    for module in (np.linalg._umath_linalg, lapack._flapack):  # type: ignore[attr-defined]
        # A symbol is looked up in a library and in all that it was linked with. The interpreter's
        # lock stays taken: these calls take less than releasing it.
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
    A context in which BLAS has one thread; the first of all that overlap sets it, the last back.

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
        """Set it back."""
        with self._lock:
            self._users -= 1
            if self._users == 0:
                while self._before:
                    library, count = self._before.pop()
                    library.set_count(count)


ONE_THREAD = OneThread()


def single_threaded(function: Callable[P, R]) -> Callable[P, R]:
    """
    Return a function that calls another one while BLAS has one thread.

    :param function: the other one.
    """

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        with ONE_THREAD:
            return function(*args, **kwargs)

    return call
