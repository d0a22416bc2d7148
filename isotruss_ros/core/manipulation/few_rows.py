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

from isotruss_ros.core.manipulation.limits import StackedRows
from isotruss_ros.core.numerics.arrays import Array, Indices
import numpy as np

#: With more rollers than this, few rows are quicker than all (benchmarks/scaling.py).
ALL_ROWS_UP_TO = 60
#: Rows to begin with, and to add at a time at least.
FIRST, ADDED = 16, 16
#: Bounds hold to this, in units of the program.
TOLERANCE = 1e-10

#: From cost, task, rows and their bounds to the speeds (n,) and the progress.
Solver: TypeAlias = Callable[[Array, Array, Array, Array, Array], tuple[Array, float]]


def solve_by_few_rows(
    solve: Solver,
    even: Array,
    equality: Array,
    rows: StackedRows,
    places: Indices,
    lower: Array,
    upper: Array,
    guess: Array,
) -> tuple[Array, float]:
    """
    Solve a quadratic program of the twist with the rows of limits that bind.

    :param solve: what solves it for some rows, in other variables.
    :param even: (w, w) E with |C E y| = |y|, see `WorkingRollers`.
    :param equality: (k, w) J, the task on the working rollers.
    :param rows: all rows of the limits.
    :param places: (w,) numbers of the working rollers.
    :param lower: (l,) bounds of the rows, in the units of the program.
    :param upper: (l,)
    :param guess: (w,) speeds whose shares of the bounds say which rows to begin with.
    :return: (w,) speeds and the progress.
    :raises SolverError: a program was not solved.
    """
    count = rows.count_rollers
    task = equality.dot(even)

    def beyond(speeds: Array) -> Array:
        velocities = np.zeros(count)
        velocities[places] = speeds
        rates = rows.rates(velocities)
        return np.maximum(rates - upper, lower - rates)

    chosen = np.sort(_largest(beyond(guess), FIRST))
    while True:
        some = rows.take(chosen)[:, places].dot(even)
        stacked = np.concatenate([task, some])
        basis = np.linalg.qr(stacked.T)[0]
        cost = np.eye(basis.shape[1])
        found, progress = solve(
            cost, task.dot(basis), some.dot(basis), lower[chosen], upper[chosen]
        )
        speeds = even.dot(basis.dot(found))
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
