"""
How the working rollers carry out a task within limits: as far as they allow, or along them.

Scaling keeps the direction of the twist. Sliding keeps its direction for the speed of the rollers
only, which does not depend on where the robot is; of the twists that all limits allow it takes the
nearest to what is left. It gets at least as far along the twist as scaling does: both are
admissible, and the nearest point of a convex set that holds the origin has the larger component.

As far as limits allow is further than is good for a machine: where they leave a sliver, or the
rollers next to no way to move the object, all their speed would go into a thousandth of the twist,
to and fro as the robot steps from one side of the sliver to the other. A thrifty drive trades
progress for rolling there, and elsewhere does the same. Sliding, it may then stay behind scaling
by a few per cent of the twist.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import functools

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.limits import Limit, RollerSpeedLimit, Rows
from isotruss_ros.core.program import furthest, least, nearest, PENALTIES
from isotruss_ros.core.robot import Robot
from isotruss_ros.core.task import Task
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

#: Solutions are exact to rounding; a scale this close to 1 is 1.
SCALE_TOLERANCE = 1e-9
#: Bounds and twists this many times larger than what matters are as good as infinite.
MAX_REACH = 1e9
#: Nor can the rollers ever do this many times what they would at full speed the straight way.
MAX_SCALE = 1e4
#: A limit binds when its row is this close to its bound, as a share of the rollers' speeds.
BINDING_TOLERANCE = 1e-7
#: Progress at any price: the last thousandth of a twist may take all the speed of the rollers.
ANY_PRICE, NO_THRIFT = PENALTIES[0], 1e-6
#: The thrifty price of progress: full speed of the rollers where the object's surface moves at 2 %
#: of it or more along the twist, less below; in slow loops, which step further, 2 % for each
#: `QUICK` of the period [s]. Sliding is thriftier: a tenth is worth half.
PRICE, QUICK, THRIFT = 100.0, 1e-2, 1e-2


@dataclass(frozen=True, eq=False)
class WorkingRollers:
    """
    The rollers that do not stand still, and what is constant as long as they are the same.

    :ivar places: (w,) where they are among all rollers.
    :ivar cost: (w, w) C^T C, the cost (11) of their speeds.
    :ivar even: (w, w) E with |C E y| = |y|: speeds that cost alike.
    """

    places: Indices
    cost: Array
    even: Array


@functools.lru_cache(maxsize=16)
def working_rollers(robot: Robot, failed: frozenset[str]) -> WorkingRollers:
    """
    Return the rollers that have not failed.

    :raises GraspError: the robot has no such roller.
    """
    unknown = failed - set(robot.roller_names)
    if unknown:
        raise GraspError(
            f'failed rollers {", ".join(sorted(map(repr, unknown)))}: robot {robot.name} has no '
            f'such rollers; its rollers are {", ".join(robot.roller_names)}'
        )
    places = np.array(
        [i for i, name in enumerate(robot.roller_names) if name not in failed], dtype=int
    )
    incidence = robot.layout.incidence[:, places]
    cost = incidence.T @ incidence
    return WorkingRollers(places, cost, np.linalg.inv(np.linalg.cholesky(cost)).T)


@dataclass(frozen=True, eq=False)
class Drive:
    """
    What the rollers do for a task.

    :ivar velocities: (r,) of all rollers [m/s].
    :ivar scale: how much of the task is done: the component along it, 0 to 1.
    :ivar slid: whether the direction is another than that of the task.
    :ivar binding: which rows of the limits are at their bounds; none at scale 1.
    """

    velocities: Array
    scale: float
    slid: bool
    binding: NDArray[np.bool_]


def drive(
    robot: Robot,
    working: WorkingRollers,
    task: Task,
    limits: Sequence[Limit],
    limit_rows: Sequence[Rows],
    slide: bool,
    period: float,
) -> Drive:
    """
    Carry out a task as far as limits allow.

    :param limit_rows: the rows of `limits`, in the same order.
    :param slide: along limits on where the robot may be, rather than stop at them.
    :param period: for which the command will hold [s]: it leaves progress that takes far more
        rolling than it is worth. Zero for as far as limits allow at this instant.
    :raises SolverError: a program was not solved.
    """
    upper = np.concatenate([np.zeros(0), *(rows.upper for rows in limit_rows)])
    lower = np.concatenate([np.zeros(0), *(rows.lower for rows in limit_rows)])
    # What the rollers would do without limits, of size 1, and how quick that is [m/s].
    wish = np.zeros(len(robot.roller_names))
    wish[working.places] = least(working.even, task.equality, task.direction)
    gain = float(np.abs(wish).max())
    wish, asked = wish / gain, gain * task.speed
    pull = np.concatenate([np.zeros(0), *(rows.matrix @ wish for rows in limit_rows)])
    with np.errstate(over='ignore'):
        free = (pull <= upper / asked) & (pull >= lower / asked)
    if free.all():
        return Drive(wish * asked, 1.0, False, ~free)
    # In units of the slower of what is asked and what can be: the solver's tolerance is absolute.
    unit = min(robot.description.max_speed, asked)
    with np.errstate(over='ignore'):
        lower, upper = np.maximum(lower / unit, -MAX_REACH), np.minimum(upper / unit, MAX_REACH)
    matrix = np.vstack([rows.matrix for rows in limit_rows])[:, working.places]
    reach = min(asked / unit, MAX_SCALE)
    speed = np.concatenate(
        [
            np.full(len(rows.upper), not slide or isinstance(limit, RollerSpeedLimit))
            for limit, rows in zip(limits, limit_rows, strict=True)
        ]
    )
    direction = task.direction / gain
    price = ANY_PRICE
    if period > 0.0:
        worth = PRICE * min(1.0, QUICK / period)
        price = min(price, worth * robot.description.max_speed / (unit * gain))
    solution, reached = furthest(
        working.cost,
        task.equality,
        direction,
        reach,
        matrix[speed],
        lower[speed],
        upper[speed],
        price,
    )
    value = matrix @ solution
    beyond = np.maximum(value - upper, lower - value)
    slid = slide and bool((beyond > BINDING_TOLERANCE).any())
    if slid:
        solution = nearest(
            working.cost,
            task.equality,
            reached * direction,
            task.rank,
            matrix,
            lower,
            upper,
            THRIFT if period > 0.0 else NO_THRIFT,
        )
        value = matrix @ solution
        reached = gain * float(task.direction @ (task.equality @ solution))
    # A step toward the wish would go on along the twist: a row at its bound must forbid it.
    slack = np.minimum(upper - value, value - lower)
    scale = min(1.0, max(0.0, reached * unit / gain / task.speed))
    velocities = np.zeros(len(robot.roller_names))
    velocities[working.places] = solution * unit
    return Drive(
        velocities,
        1.0 if scale > 1.0 - SCALE_TOLERANCE else scale,
        slid,
        (slack < BINDING_TOLERANCE) & ~free,
    )
