# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Execution of a twist under limits, either by scaling it or by sliding along the limits.

Scaling keeps the direction of the twist. Sliding scales the twist only as far as the limits of
roller speed require; then it projects the twist on the convex set of twists that the other limits
admit. The projection's component along the twist is at least as large as the scaled twist.

If the set of admissible twists is nearly empty, full roller speed would produce a thousandth of
the twist, with a sign that alternates from cycle to cycle. So a regularisation reduces the
deviation from the least-cost speeds of the scaled twist, at the expense of progress along the
twist. It is zero without limits, so the command does not jump where a limit begins to bind.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.limits import Limit, Rows
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.manipulation.task import Task
from isotruss_ros.core.manipulation.twist_qp import (
    EXACT_PENALTY,
    least_deviation,
    maximize_progress,
)
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.tolerances import NEGLIGIBLE_SHARE, ROUNDING
import numpy as np

#: Weight of progress along a scaled twist, and of the error of the twist while sliding, relative
#: to the deviation from the least-cost speeds of the scaled twist [-]. While the heading turns at
#: limits and singular tasks of the nine-member robot, rollers go back and forth by more than
#: 1 mm/s in 3 of 4872 cycles of 10 ms. With 5 they do so in 4, with 100 in 67.
PROGRESS_WEIGHT = 20.0
#: Value of `LimitHandling.soft_rank` in control loops [-]. In the runs of `PROGRESS_WEIGHT`,
#: rollers go back and forth in 183 cycles with 0, in 61 with 0.02, in 3 with 0.07, and in 6 with
#: 0.22. With 0.07, four other robots do so in at most 4 of 360 cycles at 20, 50 and 100 mm/s.
LOOP_SOFT_RANK = 0.07


@dataclass(frozen=True)
class LimitHandling:
    """Choice of the behaviour of a command at binding limits."""

    #: True to project the twist on the admissible twists at limits of the configuration; otherwise
    #: the twist is scaled
    slide_along_limits: bool = False
    #: True for the regularisation of control loops; otherwise largest progress
    regularized: bool = False
    #: singular value of the task below which a direction of the twist counts as partly reachable,
    #: to a fraction that falls to 0 with the singular value [-]; 0: a direction is reachable or
    #: not, as in the paper
    soft_rank: float = 0.0


def apply_limits(
    config: Configuration, task: Task, limits: Sequence[Limit], rows: Rows, handling: LimitHandling
) -> tuple[Array, float, Status, tuple[str, ...]]:
    """Return roller velocities (r,) under limits, scale, status, and names at binding limits."""
    reach, max_speed = task.reach, config.robot.description.max_speed
    working, gain = reach.working, float(np.abs(task.free).max())
    asked = gain * task.speed
    # The solver's tolerance is absolute, so speeds are divided by the smaller of desired and
    # possible speed.
    unit = min(max_speed, asked)
    largest = unit / ROUNDING  # bounds above it are not used: the division could overflow
    bounds = Rows(
        working.take(rows.matrix),
        np.maximum(rows.lower, -largest) / unit,
        np.minimum(rows.upper, largest) / unit,
    )
    farthest, direction = min(asked / unit, 1.0 / NEGLIGIBLE_SHARE), task.direction / gain
    free = task.free / gain
    least = float(free.dot(working.cost.dot(free)))
    penalty, weight = EXACT_PENALTY, NEGLIGIBLE_SHARE
    if handling.regularized:
        penalty = min(penalty, PROGRESS_WEIGHT * max_speed / (unit * gain))
        weight = 1.0 / PROGRESS_WEIGHT
    fixed, slid = bounds, False
    if handling.slide_along_limits:
        counts = [len(limit.row_names(config)) for limit in limits]
        fixed = bounds.take(~np.repeat([limit.can_slide for limit in limits], counts))
    solution, made = maximize_progress(
        working.cost, reach.rows, direction, farthest, fixed, least, penalty
    )
    slack = bounds.slack(solution)
    if handling.slide_along_limits and (slack < -NEGLIGIBLE_SHARE).any():
        slid, rank, rates = True, len(reach.directions), bounds.matrix.dot(solution)
        moved = Rows(bounds.matrix, bounds.lower - rates, bounds.upper - rates)
        opening = made * direction[rank:]
        change = least_deviation(working.cost, reach.rows, rank, opening, moved, weight)
        solution = solution + change
        made += gain * float(task.direction.dot(reach.rows.dot(change)))
        slack = bounds.slack(solution)
    scale = min(1.0, max(0.0, made * unit / gain / task.speed))
    if made < ROUNDING:
        # Speeds without progress are rounding errors.
        solution, scale = np.zeros_like(solution), 0.0
    velocities = working.spread(solution * unit)
    if scale > 1.0 - ROUNDING:
        return velocities, 1.0, task.status, ()
    # A row binds if a step toward the free solution would violate it.
    binding = (slack < NEGLIGIBLE_SHARE) & (rows.slack(task.velocities) < 0.0)
    named = [(limit.status, name) for limit in limits for name in limit.row_names(config)]
    bound = [named[place] for place in np.flatnonzero(binding)]
    status = task.status
    if status is Status.OK:
        slowed = bound[0][0] if bound else Status.SLOWED_ROLLER_SPEED
        status = Status.SLIDING if slid else slowed
    return velocities, scale, status, tuple(name for _, name in bound)
