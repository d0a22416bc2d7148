# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Time calls and print tables; the scripts beside this file say what is measured."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib.metadata import version
import os
from pathlib import Path
import platform
import time
from typing import Any

import numpy as np
import scipy

#: Share of the work of every benchmark: of states, objects, times and so on; tests take little.
SHARE = float(os.environ.get('BENCHMARK_SHARE', '1'))
#: The solver that peers of the quadratic programs use, and its options.
PEER, PEER_OPTIONS = 'daqp', {'primal_tol': 1e-9}


def part(number: int) -> int:
    """Return the share of a number that this run takes, at least one."""
    return max(1, round(SHARE * number))


def timed(call: Callable[[], Any]) -> tuple[float, Any]:
    """
    Return the time of one call [s], and what it returns.

    It is the CPU time of this thread: what else the machine does should not count.
    """
    start = time.thread_time_ns()
    result = call()
    return 1e-9 * (time.thread_time_ns() - start), result


def median_time(call: Callable[[], Any], budget: float, most: int = 2000) -> float:
    """
    Return the median time of a call [s], after one that is not counted.

    :param budget: about how long to go on [s]; at least five calls.
    """
    call()
    budget *= SHARE
    times: list[float] = []
    while len(times) < most and (len(times) < 5 or sum(times) < budget):
        times.append(timed(call)[0])
    return float(np.median(times))


def print_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print columns, the first one left-aligned and the others right-aligned."""
    widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    for row in (header, ['-' * width for width in widths], *rows):
        first, *others = row
        cells = [cell.rjust(width) for cell, width in zip(others, widths[1:], strict=True)]
        print('  '.join([first.ljust(widths[0]), *cells]).rstrip())


def print_machine() -> None:
    """Print what the numbers depend on."""
    cpuinfo = Path('/proc/cpuinfo')
    lines = cpuinfo.read_text(encoding='utf-8').splitlines() if cpuinfo.is_file() else []
    names = [line.split(':')[1].strip() for line in lines if line.startswith('model name')]
    print(
        f'{names[0] if names else platform.machine()}, one core '
        f'(OPENBLAS_NUM_THREADS={os.environ.get("OPENBLAS_NUM_THREADS")}); '
        f'Python {platform.python_version()}, NumPy {np.__version__}, SciPy {scipy.__version__}, '
        f'peers: qpsolvers {version("qpsolvers")} with {PEER}\n'
    )
