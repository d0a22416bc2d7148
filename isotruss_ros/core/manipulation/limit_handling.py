# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How the working rollers carry out a task that limits bind: scaled, or sliding along the limits.

Scaling keeps the direction of the twist. Sliding keeps its direction for the limits of roller
speed only, which do not depend on the configuration; of the twists that all limits admit it takes
the closest to the remaining one. Its component along the twist is at least that of scaling: both
are admissible, and the closest point of a convex set that contains the origin has the larger one.

The largest admissible progress is not always good for a machine: where limits leave a sliver, or
the rollers hardly move the object, all their speed would go into a thousandth of the twist, and
its sign would change from cycle to cycle. With regularization, progress is traded against roller
speed there. Sliding may then stay behind scaling by a few per cent of the twist.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.limits import Limit, name_binding_rows, Rows
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.manipulation.task import Task
from isotruss_ros.core.manipulation.twist_qp import maximize_progress, PENALTIES, project_target
from isotruss_ros.core.numerics.arrays import Array, Indices
import numpy as np

#: Solutions are exact to rounding; a scale this close to 1 is 1, and this
#: much progress, in speeds of the rollers, is none.
SCALE_TOLERANCE = 1e-9
#: Bounds and twists this many times larger than the problem's scale are as good as infinite.
MAX_REACH = 1e9
#: Largest ratio of admissible progress to that of the least-cost solution at full speed.
MAX_SCALE = 1e4
#: A limit binds when its row is this close to its bound, as a share of the rollers' speeds.
BINDING_TOLERANCE = 1e-7
#: Regularization weight that only makes the closest point unique.
LEAST_REGULARIZATION = 1e-6
#: With more rollers than this, few rows are quicker than all (benchmarks/scaling.py).
ALL_ROWS_UP_TO = 60
#: Rows to begin with, and to add at a time at least.
FIRST, ADDED = 16, 16
#: Bounds hold to this, in units of the program.
ROW_TOLERANCE = 1e-10
#: Full roller speed is used where the surface of the object moves at 2 / `PROGRESS_WEIGHT` of it
#: or more along the twist, less below [-]. In loops slower than `REFERENCE_PERIOD` [s], the weight
#: falls with the period.
PROGRESS_WEIGHT, REFERENCE_PERIOD = 100.0, 1e-2
#: Weight of the roller speeds against the error of the twist when sliding [-].
SLIDE_WEIGHT = 1e-2

#: From cost, task and rows to the speeds (n,) and the progress.
Solver: TypeAlias = Callable[[Array, Array, Rows], tuple[Array, float]]


@dataclass(frozen=True)
class LimitHandling:
    """
    What a command does where limits bind.

    :ivar slide_along_limits: rather than stop at limits of lengths and shapes.
    :ivar period: of the loop [s]: progress that takes far more roller speed than it yields is
        left. Zero for the largest progress.
    """

    slide_along_limits: bool = False
    period: float = 0.0


def apply_limits(
    config: Configuration,
    task: Task,
    limits: Sequence[Limit],
    rows: Rows,
    handling: LimitHandling,
) -> tuple[Array, float, Status, tuple[str, ...]]:
    """
    Carry out a task as far as limits allow.

    :param config: configuration of the robot.
    :param task: the task.
    :param limits: the limits.
    :param rows: their rows, see `stack_rows`.
    :param handling: what to do where they bind.
    :return: velocities (r,) of the rollers [m/s], and of the command scale, status and limiting.
    :raises SolverError: a quadratic program was not solved.
    """
    reach, max_speed = task.reach, config.robot.description.max_speed
    working, gain = reach.working, float(np.abs(task.free).max())
    asked = gain * task.speed
    # In units of the slower of what is asked and what can be: the solver's tolerance is absolute.
    unit = min(max_speed, asked)
    largest = MAX_REACH * unit  # before the division, which could overflow
    bounds = Rows(
        working.take(rows.matrix),
        np.maximum(rows.lower, -largest) / unit,
        np.minimum(rows.upper, largest) / unit,
    )
    farthest, direction = min(asked / unit, MAX_SCALE), task.direction / gain
    penalty, weight, guess = PENALTIES[0], LEAST_REGULARIZATION, None
    if handling.period > 0.0:
        slower = min(1.0, REFERENCE_PERIOD / handling.period)
        penalty = min(penalty, PROGRESS_WEIGHT * slower * max_speed / (unit * gain))
        weight, guess = SLIDE_WEIGHT, task.free / gain

    def progress(cost: Array, equality: Array, limited: Rows) -> tuple[Array, float]:
        return maximize_progress(cost, equality, direction, farthest, limited, penalty)

    fixed, slid = bounds, False
    if handling.slide_along_limits:
        counts = [len(limit.row_names(config)) for limit in limits]
        fixed = bounds.take(~np.repeat([limit.can_slide for limit in limits], counts))
    solution, made = _solve(task, progress, fixed, guess)
    slack = bounds.slack(solution)
    if handling.slide_along_limits and (slack < -BINDING_TOLERANCE).any():
        target, slid = made * direction, True

        def closest(cost: Array, equality: Array, limited: Rows) -> tuple[Array, float]:
            rank = len(reach.directions)
            found = project_target(cost, equality, target, rank, limited, weight)
            return found, gain * float(task.direction.dot(equality.dot(found)))

        solution, made = _solve(task, closest, bounds, guess)
        slack = bounds.slack(solution)
    scale = min(1.0, max(0.0, made * unit / gain / task.speed))
    if made < SCALE_TOLERANCE:
        # Speeds that make no progress are rounding of the program.
        solution, scale = np.zeros_like(solution), 0.0
    velocities = working.spread(solution * unit)
    if scale > 1.0 - SCALE_TOLERANCE:
        return velocities, 1.0, task.status, ()
    # A step toward the free solution would go on along the twist: a row at its bound forbids it.
    binding = (slack < BINDING_TOLERANCE) & (rows.slack(task.velocities) < 0.0)
    slowed, limiting = name_binding_rows(config, limits, binding)
    if task.status is Status.OK:
        return velocities, scale, Status.SLIDING if slid else slowed, limiting
    return velocities, scale, task.status, limiting


def _solve(task: Task, solve: Solver, rows: Rows, guess: Array | None) -> tuple[Array, float]:
    """
    Solve a quadratic program with all rows, or on a large robot with those that bind.

    Without a guess all rows count: without regularization those that bind are many, since the last
    bit of progress takes all rollers.
    """
    working, equality = task.reach.working, task.reach.rows
    if guess is not None and len(working.places) > ALL_ROWS_UP_TO:
        return solve_by_few_rows(solve, working.even, equality, rows, guess)
    return solve(working.cost, equality, rows)


def solve_by_few_rows(
    solve: Solver, even: Array, equality: Array, rows: Rows, guess: Array
) -> tuple[Array, float]:
    """
    Solve a quadratic program of the twist with the rows of limits that bind.

    In place of `solve(cost, equality, rows)`. A solution with some of the rows that fulfils all
    others is the solution with all: the programs are strictly convex, and what is left out only
    has to be admitted. So rows are added as they are violated, a few times. With the rows S the
    least-cost speeds are combinations of as many vectors as there are rows in the task and in S:
    u = E y with |C E y| = |y|, and y in the span of E^T [J^T, G_S^T], since what is at right
    angles to it costs and changes nothing else.

    :param solve: what solves it for some rows, in other variables.
    :param even: (w, w) E, see `WorkingRollers`.
    :param equality: (k, w) J, the task on the working rollers.
    :param rows: all rows of the limits, with bounds in the units of the program.
    :param guess: (w,) speeds whose shares of the bounds say which rows to begin with.
    :return: (w,) speeds and the progress.
    :raises SolverError: a program was not solved.
    """
    task = equality.dot(even)
    chosen = np.sort(_largest(-rows.slack(guess), FIRST))
    while True:
        some = rows.take(chosen)
        matrix = some.matrix.dot(even)
        basis = np.linalg.qr(np.concatenate([task, matrix]).T)[0]
        cost, reduced = np.eye(basis.shape[1]), some._replace(matrix=matrix.dot(basis))
        found, progress = solve(cost, task.dot(basis), reduced)
        speeds = even.dot(basis.dot(found))
        excess = -rows.slack(speeds)
        excess[chosen] = -np.inf
        violated = int((excess > ROW_TOLERANCE).sum())
        if not violated:
            return speeds, progress
        added = _largest(excess, min(violated, max(ADDED, len(chosen))))
        chosen = np.sort(np.concatenate([chosen, added]))


def _largest(values: Array, count: int) -> Indices:
    """Return the numbers of the largest values."""
    return np.argsort(-values, kind='stable')[:count]
