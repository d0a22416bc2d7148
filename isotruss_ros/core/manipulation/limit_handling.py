# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

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

from collections.abc import Sequence
from dataclasses import dataclass
import functools

from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.few_rows import (
    ALL_ROWS_UP_TO,
    solve_by_few_rows,
    Solver,
)
from isotruss_ros.core.manipulation.limits import Limit, RollerSpeedLimit, StackedRows
from isotruss_ros.core.manipulation.task import Task
from isotruss_ros.core.manipulation.twist_qp import maximize_progress, PENALTIES, project_target
from isotruss_ros.core.model.topology import check_roller_names
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices
import numpy as np

#: Solutions are exact to rounding; a scale this close to 1 is 1.
SCALE_TOLERANCE = 1e-9
#: Bounds and twists this many times larger than the problem's scale are as good as infinite.
MAX_REACH = 1e9
#: Largest ratio of admissible progress to that of the least-cost solution at full speed.
MAX_SCALE = 1e4
#: A limit binds when its row is this close to its bound, as a share of the rollers' speeds.
BINDING_TOLERANCE = 1e-7
#: Regularization weight that only makes the closest point unique.
LEAST_REGULARIZATION = 1e-6


@dataclass(frozen=True)
class Regularization:
    """
    How progress along a twist is traded against roller speed where limits bind.

    :ivar progress_weight: full roller speed is used where the object's surface moves at
        2 / `progress_weight` of it or more along the twist, less below [-].
    :ivar reference_period: in loops slower than this, the weight falls with the period [s].
    :ivar slide_weight: weight of the roller speeds against the error of the twist when sliding
        [-].
    """

    progress_weight: float = 100.0
    reference_period: float = 1e-2
    slide_weight: float = 1e-2


@dataclass(frozen=True, eq=False)
class WorkingRollers:
    """
    The rollers that have not failed, and the cost of their speeds.

    :ivar places: (w,) their numbers among all rollers.
    :ivar cost: (w, w) C^T C, the cost (11) of their speeds [-].
    :ivar even: (w, w) E with |C E y| = |y|: speeds of equal cost [-].
    :ivar whole: whether these are all rollers of the robot.
    """

    places: Indices
    cost: Array
    even: Array
    whole: bool


@functools.lru_cache(maxsize=16)
def working_rollers(robot: Robot, failed: frozenset[str]) -> WorkingRollers:
    """
    Return the rollers that have not failed.

    :param robot: the robot.
    :param failed: names of the rollers that have failed.
    :raises GraspError: the robot has no such roller.
    """
    check_roller_names('failed rollers', failed, robot.roller_names)
    places = np.array(
        [i for i, name in enumerate(robot.roller_names) if name not in failed], dtype=int
    )
    # (11): J = |Ldot|^2, and Ldot = C phidot keeps the length of each tube (13).
    incidence = robot.topology.incidence[:, places]
    cost = incidence.T @ incidence
    even = np.linalg.inv(np.linalg.cholesky(cost)).T
    return WorkingRollers(places, cost, even, len(places) == len(robot.roller_names))


@dataclass(frozen=True, eq=False)
class LimitedVelocities:
    """
    Roller speeds for a task within limits.

    :ivar velocities: (w,) of the working rollers [m/s].
    :ivar scale: component along the task as a share of it, 0 to 1.
    :ivar slid: whether the direction differs from that of the task.
    :ivar binding: (k,) which rows of the limits are at their bounds; none at scale 1.
    """

    velocities: Array
    scale: float
    slid: bool
    binding: Flags


def apply_limits(
    working: WorkingRollers,
    task: Task,
    limits: Sequence[Limit],
    rows: StackedRows,
    admitted: Flags,
    max_speed: float,
    slide_along_limits: bool,
    period: float,
    regularization: Regularization,
) -> LimitedVelocities:
    """
    Carry out a task as far as limits allow.

    :param working: the working rollers.
    :param task: the task.
    :param limits: the limits.
    :param rows: their rows, see `stack_rows`.
    :param admitted: (k,) which rows admit the task at the least cost, without limits.
    :param max_speed: largest speed of a roller [m/s].
    :param slide_along_limits: rather than stop at limits on the configuration.
    :param period: for which the command holds [s]; zero switches regularization off.
    :param regularization: weights, see there.
    :raises SolverError: a quadratic program was not solved.
    """
    gain = float(np.abs(task.free).max())
    asked = gain * task.speed
    # In units of the slower of what is asked and what can be: the solver's tolerance is absolute.
    unit = min(max_speed, asked)
    with np.errstate(over='ignore'):
        lower = np.maximum(rows.lower / unit, -MAX_REACH)
        upper = np.minimum(rows.upper / unit, MAX_REACH)
    reach = min(asked / unit, MAX_SCALE)
    direction = task.direction / gain
    penalty = PENALTIES[0]
    if period > 0.0:
        weight = regularization.progress_weight
        weight *= min(1.0, regularization.reference_period / period)
        penalty = min(penalty, weight * max_speed / (unit * gain))

    def farthest(cost: Array, equality: Array, *limited: Array) -> tuple[Array, float]:
        return maximize_progress(cost, equality, direction, reach, *limited, penalty)

    guess = task.free / gain
    solve = functools.partial(_solve, working, task, guess=guess, few=period > 0.0)
    scaling = rows
    scaled: Flags | slice = slice(None)
    if slide_along_limits:
        fixed = [isinstance(limit, RollerSpeedLimit) for limit in limits]
        scaled = np.array(fixed, dtype=bool)[rows.limit]
        scaling = StackedRows([p for p, kept in zip(rows.parts, fixed, strict=True) if kept])
    solution, progress = solve(farthest, scaling, lower[scaled], upper[scaled])
    value = _rates(working, rows, solution)
    slid = slide_along_limits and bool(
        (np.maximum(value - upper, lower - value) > BINDING_TOLERANCE).any()
    )
    if slid:
        target = progress * direction
        weight = regularization.slide_weight if period > 0.0 else LEAST_REGULARIZATION

        def closest(cost: Array, equality: Array, *limited: Array) -> tuple[Array, float]:
            found = project_target(cost, equality, target, task.rank, *limited, weight)
            return found, gain * float(task.direction.dot(equality.dot(found)))

        solution, progress = solve(closest, rows, lower, upper)
        value = _rates(working, rows, solution)
    # A step toward the free solution would go on along the twist: a row at its bound forbids it.
    slack = np.minimum(upper - value, value - lower)
    scale = min(1.0, max(0.0, progress * unit / gain / task.speed))
    return LimitedVelocities(
        solution * unit,
        1.0 if scale > 1.0 - SCALE_TOLERANCE else scale,
        slid,
        (slack < BINDING_TOLERANCE) & ~admitted,
    )


def _rates(working: WorkingRollers, rows: StackedRows, speeds: Array) -> Array:
    """Return what the rows are at speeds (w,) of the working rollers."""
    if working.whole:
        return rows.rates(speeds)
    velocities = np.zeros(rows.count_rollers)
    velocities[working.places] = speeds
    return rows.rates(velocities)


def _solve(
    working: WorkingRollers,
    task: Task,
    solve: Solver,
    rows: StackedRows,
    lower: Array,
    upper: Array,
    guess: Array,
    few: bool,
) -> tuple[Array, float]:
    """
    Solve a quadratic program with all rows, or on a large robot with those that bind.

    Without regularization they are many: the last bit of progress takes all rollers.
    """
    if not rows.parts:
        none = np.zeros((0, len(working.places)))
        return solve(working.cost, task.equality, none, lower, upper)
    if few and len(working.places) > ALL_ROWS_UP_TO:
        return solve_by_few_rows(
            solve, working.even, task.equality, rows, working.places, lower, upper, guess
        )
    matrix = rows.matrix if working.whole else rows.matrix[:, working.places]
    return solve(working.cost, task.equality, matrix, lower, upper)
