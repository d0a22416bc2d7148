# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Quadratic programs of the twist on large robots, by the few rows of the limits that bind.

A solution with some of the rows that fulfils all others is the solution with all: the programs are
strictly convex, and what is left out only has to be admitted. So rows are added as they are
violated, a few times. With the rows S the least-cost speeds are combinations of as many vectors as
there are rows in the task and in S: u = E y with |C E y| = |y|, and y in the span of
E^T [J^T, G_S^T], since what is at right angles to it costs and changes nothing else.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from isotruss_ros.core.manipulation.limits import Rows, StackedRows
from isotruss_ros.core.manipulation.task import WorkingRollers
from isotruss_ros.core.numerics.arrays import Array, Indices
import numpy as np

#: With more rollers than this, few rows are quicker than all (benchmarks/scaling.py).
ALL_ROWS_UP_TO = 60
#: Rows to begin with, and to add at a time at least.
FIRST, ADDED = 16, 16
#: Bounds hold to this, in units of the program.
TOLERANCE = 1e-10

#: From cost, task and rows to the speeds (n,) and the progress.
Solver: TypeAlias = Callable[[Array, Array, Rows], tuple[Array, float]]


def solve_by_few_rows(
    solve: Solver, working: WorkingRollers, equality: Array, rows: StackedRows, guess: Array
) -> tuple[Array, float]:
    """
    Solve a quadratic program of the twist with the rows of limits that bind.

    In place of `solve(working.cost, equality, ...)` with all rows.

    :param solve: what solves it for some rows, in other variables.
    :param working: the working rollers.
    :param equality: (k, w) J, the task on the working rollers.
    :param rows: all rows of the limits, with bounds in the units of the program.
    :param guess: (w,) speeds whose shares of the bounds say which rows to begin with.
    :return: (w,) speeds and the progress.
    :raises SolverError: a program was not solved.
    """
    task = equality.dot(working.even)

    def beyond(speeds: Array) -> Array:
        rates = rows.rates(working.spread(speeds))
        return np.maximum(rates - rows.upper, rows.lower - rates)

    chosen = np.sort(_largest(beyond(guess), FIRST))
    while True:
        some = rows.take(chosen)
        matrix = some.matrix[:, working.places].dot(working.even)
        basis = np.linalg.qr(np.concatenate([task, matrix]).T)[0]
        cost, reduced = np.eye(basis.shape[1]), some._replace(matrix=matrix.dot(basis))
        found, progress = solve(cost, task.dot(basis), reduced)
        speeds = working.even.dot(basis.dot(found))
        excess = beyond(speeds)
        excess[chosen] = -np.inf
        violated = int((excess > TOLERANCE).sum())
        if not violated:
            return speeds, progress
        added = _largest(excess, min(violated, max(ADDED, len(chosen))))
        chosen = np.sort(np.concatenate([chosen, added]))


def _largest(values: Array, count: int) -> Indices:
    """Return the numbers of the largest values."""
    return np.argsort(-values, kind='stable')[:count]
