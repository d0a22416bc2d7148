"""From the desired twist of the grasped object to roller velocities: equations (11) and (20)."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
import functools

from isotruss_ros.core.arrays import finite_array
from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.grasp import Grasp
from isotruss_ros.core.limits import Limit, MemberLengthLimit, RollerSpeedLimit, Rows
from isotruss_ros.core.program import furthest, least
from isotruss_ros.core.robot import Robot
from isotruss_ros.core.status import Status
from isotruss_ros.core.task import Task, task_jacobian
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

#: Solutions are exact to rounding; a scale this close to 1 is 1.
SCALE_TOLERANCE = 1e-9
#: Bounds and twists this many times larger than what matters are as good as infinite.
MAX_REACH = 1e9
#: A limit binds when its row is this close to its bound, as a share of the rollers' speeds.
BINDING_TOLERANCE = 1e-7


@dataclass(frozen=True, eq=False)
class RollerCommand:
    """
    What the rollers are to do, and what the object does then.

    :ivar roller_velocities: (r,) speed of the tube through each roller [m/s].
    :ivar achieved_twist: (3,) vx, vy [m/s], omega [rad/s] of the object in the robot frame,
        computed from `roller_velocities`.
    :ivar scale: 0 to 1, by which the limits shrank the (nearest reachable) twist.
    :ivar status: how the twist was answered.
    :ivar limiting: the rollers or members whose limits bind, empty at scale 1.
    """

    roller_velocities: Array
    achieved_twist: Array
    scale: float
    status: Status
    limiting: tuple[str, ...] = ()


def default_limits(robot: Robot) -> tuple[Limit, ...]:
    """Return the limits that the robot file states."""
    file = robot.description
    return (
        RollerSpeedLimit(file.max_speed),
        MemberLengthLimit(file.min_length, file.max_length),
    )


def solve_twist(
    config: Configuration,
    grasp: Grasp,
    twist: ArrayLike,
    failed: Collection[str] = (),
    limits: Sequence[Limit] | None = None,
) -> RollerCommand:
    """
    Find the roller velocities that move the grasped object as asked, at least change of members.

    The grip keeps its opening angle (14) and every tube its length (13), whatever is asked. A
    twist that cannot be reached is replaced by the nearest that can, in the measure
    |v|^2 + |omega d/2|^2. When limits bind, the direction is kept and the size scaled.

    :param config: where the robot is.
    :param grasp: what it holds, and where.
    :param twist: (3,) vx, vy [m/s], omega [rad/s] of the object in the robot frame.
    :param failed: names of rollers that stand still whatever they are told.
    :param limits: limits in place of those of the robot file.
    :raises GraspError: the grasp, the twist or a name in `failed` is not usable.
    :raises ConfigurationError: the configuration is singular.
    :raises SolverError: the program was not solved.
    """
    robot = config.robot
    wanted = finite_array(twist, 3, 'the twist (vx, vy [m/s], omega [rad/s])', GraspError)
    working = _working_rollers(robot, frozenset([failed] if isinstance(failed, str) else failed))
    jacobian = task_jacobian(config, grasp)
    velocities = np.zeros(len(robot.roller_names))
    if not wanted.any():
        return RollerCommand(velocities, np.zeros(3), 1.0, Status.IDLE)

    task = Task(jacobian[:, working.places], 0.5 * grasp.diameter, wanted)
    status = Status.OK if task.reachable else Status.UNREACHABLE
    scale, limiting = 1.0, ()
    if task.speed > 0.0:
        limits = default_limits(robot) if limits is None else limits
        rows = [limit.rows(config) for limit in limits]
        velocities, scale, binding = _drive(robot, working, task, rows)
        if scale < 1.0:
            slowed, limiting = _binding(config, limits, rows, binding)
            status = slowed if task.reachable else status
    return RollerCommand(velocities, jacobian[:3] @ velocities, scale, status, limiting)


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
def _working_rollers(robot: Robot, failed: frozenset[str]) -> WorkingRollers:
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


def _drive(
    robot: Robot, working: WorkingRollers, task: Task, limit_rows: Sequence[Rows]
) -> tuple[Array, float, NDArray[np.bool_]]:
    """Return the velocities (r,) [m/s] of all rollers, the scale, and which rows bind."""
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
        return wish * asked, 1.0, ~free
    # In units of the slower of what is asked and what can be: the solver's tolerance is absolute.
    unit = min(robot.description.max_speed, asked)
    with np.errstate(over='ignore'):
        lower, upper = np.maximum(lower / unit, -MAX_REACH), np.minimum(upper / unit, MAX_REACH)
    matrix = np.vstack([rows.matrix for rows in limit_rows])[:, working.places]
    solution, reached = furthest(
        working.cost,
        task.equality,
        task.direction / gain,
        min(asked / unit, MAX_REACH),
        matrix,
        lower,
        upper,
    )
    # A step toward the wish would go on along the twist: a row at its bound must forbid it.
    value = matrix @ solution
    slack = np.minimum(upper - value, value - lower)
    scale = min(1.0, reached * unit / gain / task.speed)
    velocities = np.zeros(len(robot.roller_names))
    velocities[working.places] = solution * unit
    return (
        velocities,
        1.0 if scale > 1.0 - SCALE_TOLERANCE else scale,
        (slack < BINDING_TOLERANCE) & ~free,
    )


def _binding(
    config: Configuration,
    limits: Sequence[Limit],
    limit_rows: Sequence[Rows],
    binding: NDArray[np.bool_],
) -> tuple[Status, tuple[str, ...]]:
    """Return the status of the first limit that binds, and the names of all rows that do."""
    statuses: list[Status] = []
    names: list[str] = []
    start = 0
    for limit, rows in zip(limits, limit_rows, strict=True):
        stop = start + len(rows.upper)
        binds = np.flatnonzero(binding[start:stop])
        start = stop
        if len(binds):
            statuses.append(limit.status)
            names += [limit.row_names(config)[i] for i in binds]
    return (statuses[0] if statuses else Status.SLOWED_ROLLER_SPEED), tuple(names)
