"""From the desired twist of the grasped object to roller velocities: equations (11) and (20)."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from isotruss_ros.core.arrays import finite_array
from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.drive import drive, working_rollers
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.grasp import Grasp
from isotruss_ros.core.limits import Limit, MemberLengthLimit, RollerSpeedLimit, Rows
from isotruss_ros.core.robot import Robot
from isotruss_ros.core.status import Status
from isotruss_ros.core.task import Reach, Task, task_jacobian
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RollerCommand:
    """
    What the rollers are to do, and what the object does then.

    :ivar roller_velocities: (r,) speed of the tube through each roller [m/s].
    :ivar achieved_twist: (3,) vx, vy [m/s], omega [rad/s] of the object in the robot frame,
        computed from `roller_velocities`.
    :ivar scale: 0 to 1, by which the limits shrank the (nearest reachable) twist; where it slides,
        the component along that.
    :ivar status: how the twist was answered.
    :ivar limiting: the rollers, members and so on whose limits bind, empty at scale 1.
    :ivar mobility: how many independent motions of the object the working rollers can bring about
        here, 0 to 3; 0 too where they are stopped for want of inputs.
    """

    roller_velocities: Array
    achieved_twist: Array
    scale: float
    status: Status
    limiting: tuple[str, ...] = ()
    mobility: int = 0


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
    slide: bool = False,
    period: float = 0.0,
) -> RollerCommand:
    """
    Find the roller velocities that move the grasped object as asked, at least change of members.

    The grip keeps its opening angle (14) and every tube its length (13), whatever is asked. A
    twist that cannot be reached is replaced by the nearest that can, in the measure
    |v|^2 + |omega d/2|^2. When limits bind, the direction is kept and the size scaled; or, with
    `slide`, the nearest twist that they allow is carried out, see `drive`.

    :param config: where the robot is.
    :param grasp: what it holds, and where.
    :param twist: (3,) vx, vy [m/s], omega [rad/s] of the object in the robot frame.
    :param failed: names of rollers that stand still whatever they are told.
    :param limits: limits in place of those of the robot file.
    :param slide: along the limits of lengths and shapes, rather than stop at them.
    :param period: of the loop whose command this is [s]: where limits bind, it leaves progress
        that takes far more rolling than it is worth, see `drive`. Zero leaves nothing.
    :raises GraspError: the grasp, the twist or a name in `failed` is not usable.
    :raises ConfigurationError: the configuration is singular.
    :raises SolverError: the program was not solved.
    """
    robot = config.robot
    wanted = finite_array(twist, 3, 'the twist (vx, vy [m/s], omega [rad/s])', GraspError)
    working = working_rollers(robot, frozenset([failed] if isinstance(failed, str) else failed))
    jacobian = task_jacobian(config, grasp)
    reach = Reach.of(jacobian[:, working.places], 0.5 * grasp.diameter)
    velocities = np.zeros(len(robot.roller_names))
    if not wanted.any():
        return RollerCommand(velocities, np.zeros(3), 1.0, Status.IDLE, (), reach.rank)

    task = Task(reach, wanted)
    status = Status.OK if task.reachable else Status.UNREACHABLE
    if task.speed == 0.0:
        return RollerCommand(velocities, np.zeros(3), 1.0, status, (), reach.rank)
    limits = default_limits(robot) if limits is None else limits
    rows = [limit.rows(config) for limit in limits]
    driven = drive(robot, working, task, limits, rows, slide, period)
    limiting: tuple[str, ...] = ()
    if driven.scale < 1.0:
        slowed, limiting = _binding(config, limits, rows, driven.binding)
        if task.reachable:
            status = Status.SLIDING if driven.slid else slowed
    velocities = driven.velocities
    achieved = jacobian[:3] @ velocities
    return RollerCommand(velocities, achieved, driven.scale, status, limiting, reach.rank)


def remaining_task(config: Configuration, grasp: Grasp, failed: Collection[str]) -> Array:
    """
    Return the motions of the object that the working rollers can still bring about.

    :param failed: names of the rollers that stand still.
    :return: (k, 3) twists vx, vy, omega, as many as are independent, orthonormal in the measure
        |v|^2 + |omega d/2|^2; the grip keeps its angle in all of them.
    :raises GraspError: the grasp or a name in `failed` is not usable.
    :raises ConfigurationError: the configuration is singular.
    """
    working = working_rollers(config.robot, frozenset(failed))
    active = task_jacobian(config, grasp)[:, working.places]
    reach = Reach.of(active, 0.5 * grasp.diameter)
    return reach.directions / np.array([1.0, 1.0, reach.radius])


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
