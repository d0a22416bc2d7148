# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Timing of calls, and tables of results."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
import os
from pathlib import Path
import platform
import time
from typing import Any

import numpy as np
import scipy

#: Factor on the numbers of states and objects and on the durations of all benchmarks [-]; small in
#: tests.
SHARE = float(os.environ.get('BENCHMARK_SHARE', '1'))


@dataclass(frozen=True)
class Table:
    """
    Table of results, printed in Markdown.

    :ivar title: title of the table; empty if the page has the title.
    :ivar header: names of the columns, with units.
    :ivar rows: cells; the first column is left-aligned.
    """

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]

    def __str__(self) -> str:
        """Return the table as text."""
        widths = [max(map(len, column)) for column in zip(self.header, *self.rows, strict=True)]
        marks = [
            width * '-' if not i else (width - 1) * '-' + ':' for i, width in enumerate(widths)
        ]
        lines = [self.title, ''] if self.title else []
        for first, *others in (self.header, marks, *self.rows):
            cells = [cell.rjust(width) for cell, width in zip(others, widths[1:], strict=True)]
            lines.append(f'| {" | ".join([first.ljust(widths[0]), *cells])} |')
        return '\n'.join(lines)


def part(number: int) -> int:
    """Return a number times `SHARE`, at least one."""
    return max(1, round(SHARE * number))


def timed(call: Callable[[], Any]) -> tuple[float, Any]:
    """Return the CPU time of this thread for one call [s], and its result."""
    start = time.thread_time_ns()
    result = call()
    return 1e-9 * (time.thread_time_ns() - start), result


def median_time(call: Callable[[], Any], budget: float, most: int = 2000) -> float:
    """
    Return the median time of a call after a first call that does not count [s].

    :param budget: approximate duration of the measurement [s], in which at least five calls are
        made.
    """
    call()
    budget *= SHARE
    times: list[float] = []
    while len(times) < most and (len(times) < 5 or sum(times) < budget):
        times.append(timed(call)[0])
    return float(np.median(times))


def machine() -> str:
    """Return processor, Python version and library versions."""
    cpuinfo = Path('/proc/cpuinfo')
    lines = cpuinfo.read_text(encoding='utf-8').splitlines() if cpuinfo.is_file() else []
    names = [line.split(':')[1].strip() for line in lines if line.startswith('model name')]
    return (
        f'{names[0] if names else platform.machine()}, one core, Python '
        f'{platform.python_version()}, NumPy {np.__version__}, SciPy {scipy.__version__}'
    )
