# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Worker processes of a search, which end with their parent process, and the end of a search."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
import contextlib
import math
import multiprocessing
from multiprocessing.connection import Connection
import os
import signal
import threading
import time
from typing import Any, TYPE_CHECKING

if TYPE_CHECKING:
    from distributed import Client

#: Largest number of processes [-].
MAX_WORKERS = 256


def core_count() -> int:
    """Return the number of cores available to this process."""
    if hasattr(os, 'sched_getaffinity'):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class WorkerPool(contextlib.AbstractContextManager):
    """
    Pool of processes that start with the first task and end at `close` or with this process.

    The processes are spawned, because it is unsafe to fork a process with threads. On two cores,
    two processes search 1.6 times as fast as one process.

    :ivar executor: executor to be passed to `plan_grasps`, unusable after a worker has died.
    :param workers: number of processes; 0: the number of cores.
    """

    def __init__(self, workers: int = 0) -> None:
        wanted, self._wanted = multiprocessing.Pipe(duplex=False)
        self.executor: ProcessPoolExecutor = WorkerExecutor(
            workers or core_count(),
            multiprocessing.get_context('spawn'),
            initializer=_begin,
            initargs=(wanted,),
        )

    def __exit__(self, *_error: object) -> None:
        """Close the pool."""
        self.close()

    def close(self) -> None:
        """End the processes, and wait for it; no other thread may submit tasks meanwhile."""
        self._wanted.close()
        self.executor.shutdown(cancel_futures=True)


@contextlib.contextmanager
def dask_client(address: str | None, workers: int = 0) -> Iterator[Client]:
    """
    Connect to a Dask cluster at an address; None: start one of processes on this machine.

    :param workers: number of these processes; 0: the number of cores.
    :raises BrokenExecutor: workers died repeatedly at the same task.
    """
    from distributed import Client, KilledWorker, LocalCluster

    with contextlib.ExitStack() as stack:
        if address is None:
            count = workers or core_count()
            cluster = LocalCluster(count, threads_per_worker=1, dashboard_address=None)
            address = stack.enter_context(cluster).scheduler_address
        try:
            yield stack.enter_context(Client(address))
        except KilledWorker as error:
            raise BrokenExecutor(str(error)) from error


class Stop:
    """Condition under which a search stops: a request, or a time limit [s]; 0: no limit."""

    def __init__(self, time_limit: float = 0.0) -> None:
        self._deadline = time.monotonic() + (time_limit or math.inf)
        self.requested = False  #: whether a stop was requested

    @property
    def time_left(self) -> float:
        """Return the time until the time limit of the search is reached [s]."""
        return max(0.0, self._deadline - time.monotonic())

    def __call__(self) -> bool:
        """Return whether the search must stop now; `plan_grasps` calls it."""
        return self.requested or self.time_left == 0.0


class WorkerExecutor(ProcessPoolExecutor):
    """Executor whose processes ignore Ctrl-C, which raises only after they have started."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Submit a task, and start the processes with Ctrl-C blocked, which they inherit."""
        # After the processes it starts the thread that joins them.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            return super().submit(fn, *args, **kwargs)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin(wanted: Connection) -> None:
    """Initialise a worker process of the search."""
    os.nice(5)  # control loops have priority
    threading.Thread(target=_end_with, args=(wanted,), daemon=True).start()


def _end_with(wanted: Connection) -> None:
    """End this process when its pool is closed or its parent has ended."""
    wanted.poll(None)
    os._exit(1)
