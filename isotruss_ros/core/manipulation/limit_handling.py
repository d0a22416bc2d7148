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

The quadratic program (QP) for the largest progress along a twist at least cost (11) is

    minimize   1/2 |C (u - s f)|^2 - rho (s - s^2 / (4 s_max))
    subject to J u = s * direction,  0 <= s <= s_max,  lower <= G u <= upper

with the least-cost speeds f of `least_cost`. J (u - s f) = 0, so the first term is
1/2 |C u|^2 - 1/2 s^2 |C f|^2. The second term is an exact penalty if rho is large: its slope is at
least rho / 2. Then the progress s is the largest possible one, and the cost is minimal for this s.
The direction must be scaled such that u and s have equal magnitudes. Without binding limits the
solution is s_max * f for every rho. At binding limits `least_deviation` deviates from the
direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.limits import Limit, Rows
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.manipulation.task import Task
from isotruss_ros.core.numerics.arrays import Array, Flags
from isotruss_ros.core.numerics.qp import QuadraticProgram, require_solution, solve_qp
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
#: Penalty rho relative to |C u|^2 with |u| of order 1 that is exact up to rounding [-].
EXACT_PENALTY = 1e8


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
    """Return the roller speeds (r,) of a task under limits, its scale, status and binding rows."""
    max_speed = config.robot.description.max_speed
    row_limits = [(limit, name) for limit in limits for name in limit.row_names(config)]
    slides = np.array([limit.can_slide for limit, _ in row_limits]) & handling.slide_along_limits
    speeds, scale, slack, is_sliding = _limit_speeds(task, rows, slides, max_speed, handling)
    velocities = task.reach.working.spread(speeds)
    if scale > 1.0 - ROUNDING:
        return velocities, 1.0, task.status, ()
    # A row without slack binds if the unlimited speeds violate it.
    is_binding = (slack < NEGLIGIBLE_SHARE) & (rows.slack(task.velocities) < 0.0)
    binding = [row_limits[i] for i in np.flatnonzero(is_binding)]
    status = task.status
    if status is Status.OK:
        slowed = binding[0][0].status if binding else Status.SLOWED_ROLLER_SPEED
        status = Status.SLIDING if is_sliding else slowed
    return velocities, scale, status, tuple(name for _, name in binding)


def _limit_speeds(
    task: Task, rows: Rows, slides: Flags, max_speed: float, handling: LimitHandling
) -> tuple[Array, float, Array, bool]:
    """
    Return the working rollers' speeds (w,) under limits [m/s], and the scale of the twist.

    Also return the slack of all rows, relative to the largest roller speed, and whether the
    twist is projected on the rows along which it slides.
    """
    reach, working, dof = task.reach, task.reach.working, len(task.reach.directions)
    # The solver's tolerance is absolute, so roller speeds are divided by a unit, the smaller of
    # desired and possible speed. Larger bounds are not used, because the division could overflow.
    gain = float(np.abs(task.free).max())  # largest roller speed per unit of `task.speed` [-]
    desired_speed = gain * task.speed  # largest of the least-cost speeds [m/s]
    unit = min(max_speed, desired_speed)
    largest = unit / ROUNDING
    bounds = Rows(
        rows.matrix.take(working.indices, -1),
        np.maximum(rows.lower, -largest) / unit,
        np.minimum(rows.upper, largest) / unit,
    )
    # For a progress of 1 along this direction, the largest of the least-cost speeds is 1.
    direction, free = task.direction / gain, task.free / gain
    max_progress = min(desired_speed / unit, 1.0 / NEGLIGIBLE_SHARE)
    free_cost = float(free.dot(working.cost.dot(free)))
    penalty, regularization = EXACT_PENALTY, NEGLIGIBLE_SHARE
    if handling.regularized:
        penalty = min(penalty, PROGRESS_WEIGHT * max_speed / (unit * gain))
        regularization = 1.0 / PROGRESS_WEIGHT

    # Scaling: largest progress under the limits along which the twist cannot slide.
    scaling_bounds = Rows(*(part[~slides] for part in bounds))
    solution, progress = max_progress * free, max_progress
    if (scaling_bounds.slack(solution) < 0.0).any():
        solution, progress = maximize_progress(
            working.cost, reach.rows, direction, max_progress, scaling_bounds, free_cost, penalty
        )
    slack = bounds.slack(solution)

    # Sliding: least deviation from these speeds under all limits. Its component along the unit
    # vector `task.direction` is progress, in units of `direction`.
    is_sliding = handling.slide_along_limits and bool((slack < -NEGLIGIBLE_SHARE).any())
    if is_sliding:
        opening, room = progress * direction[dof:], bounds.about(solution)
        change = least_deviation(working.cost, reach.rows, dof, opening, room, regularization)
        solution = solution + change
        progress += gain * float(task.direction.dot(reach.rows.dot(change)))
        slack = bounds.slack(solution)
    if progress < ROUNDING:  # speeds without progress are rounding errors
        return np.zeros_like(solution), 0.0, slack, is_sliding
    return solution * unit, min(1.0, progress * unit / gain / task.speed), slack, is_sliding


def maximize_progress(
    cost: Array,
    equality: Array,
    direction: Array,
    max_progress: float,
    limited: Rows,
    free_cost: float,
    penalty: float = EXACT_PENALTY,
) -> tuple[Array, float]:
    """
    Return the roller speeds u and the largest progress s with J u = s * direction, at least cost.

    |u| is of order 1, J has full row rank, and `free_cost` is the least cost |C f|^2 for s = 1.
    """
    # The program at the top of this module, for the unknowns (u, s).
    count = len(cost)
    hessian, gradient = np.zeros((count + 1, count + 1)), np.zeros(count + 1)
    hessian[:count, :count] = cost
    hessian[count, count] = penalty / (2.0 * max(max_progress, 1.0)) - free_cost
    gradient[count] = -penalty
    # Limits of u; then s <= max_progress and -s <= 0.
    matrix, upper = limited.one_sided()
    rows, bounds = np.zeros((len(upper) + 2, count + 1)), np.append(upper, [max_progress, 0.0])
    rows[:-2, :count], rows[-2:, count] = matrix, (1.0, -1.0)
    equations = np.concatenate([equality, -direction[:, None]], axis=1)
    target = np.zeros(len(direction))
    problem = QuadraticProgram(hessian, gradient, rows, bounds, equations, target)
    solution = require_solution(solve_qp(problem))
    return solution[:count], float(min(max(solution[count], 0.0), max_progress))


def least_deviation(
    cost: Array, equality: Array, dof: int, opening: Array, limited: Rows, regularization: float
) -> Array:
    """
    Return the change v of roller speeds, within limits on v, with the least change of the twist.

    It minimises 1/2 |J v|^2 + regularization/2 |C v|^2 with the first `dof` rows of J. The other
    rows are equalities J v = 0; if the bounds do not admit them, they become J v = -opening.
    """
    twist_rows, contact_rows = equality[:dof], equality[dof:]
    hessian = twist_rows.T @ twist_rows + regularization * cost
    gradient, target = np.zeros(len(cost)), np.zeros(len(contact_rows))
    problem = QuadraticProgram(hessian, gradient, *limited.one_sided(), contact_rows, target)
    change = solve_qp(problem)
    if change is None:
        change = solve_qp(problem._replace(target=-opening))
    return require_solution(change)
