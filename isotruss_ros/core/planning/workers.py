# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Processes for the search: one core each, and none that outlives the one that wanted it."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
import contextlib
import multiprocessing
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnContext, SpawnProcess
import os
import signal
import threading

#: BLAS is set by the environment, before NumPy is loaded. Threads of its own in every process
#: would fight for the cores.
ONE_THREAD = dict.fromkeys(('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'MKL_NUM_THREADS'), '1')
#: Control loops on the same machine go first.
NICENESS = 5
#: More processes than this were never meant.
MAX_WORKERS = 256


def core_count() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, 'sched_getaffinity'):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class WorkerPool(contextlib.AbstractContextManager):
    """
    Processes that are there from the first task until `close`, or until this process is gone.

    They begin as new interpreters: what runs the search has threads, which a fork would tear.

    :ivar executor: what `plan_grasps` takes. A worker that dies breaks it for good: close the pool
        and make another.
    :param workers: how many; as many as there are cores if 0.
    """

    def __init__(self, workers: int = 0) -> None:
        wanted, self._wanted = multiprocessing.Pipe(duplex=False)
        self.executor = ProcessPoolExecutor(
            workers or core_count(), _Context(), initializer=_begin, initargs=(wanted,)
        )

    def __exit__(self, *_error: object) -> None:
        """Close the pool."""
        self.close()

    def close(self) -> None:
        """
        End the processes at once, whatever they do, and wait until they are gone.

        Not while another thread hands out tasks.
        """
        self._wanted.close()
        self.executor.shutdown(cancel_futures=True)


class _Worker(SpawnProcess):
    """A process that begins with one BLAS thread, and leaves Ctrl-C to the one that wanted it."""

    def start(self) -> None:
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            with _environment(ONE_THREAD):
                super().start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _Context(SpawnContext):
    """Makes workers."""

    Process = _Worker


@contextlib.contextmanager
def _environment(values: dict[str, str]) -> Iterator[None]:
    """Set variables for the processes that begin meanwhile."""
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _begin(wanted: Connection) -> None:
    """Run first in every worker."""
    os.nice(NICENESS)
    threading.Thread(target=_end_with, args=(wanted,), daemon=True).start()


def _end_with(wanted: Connection) -> None:
    """End this process where the pool is closed, or its process is gone: nothing ever comes."""
    wanted.poll(None)
    os._exit(1)
