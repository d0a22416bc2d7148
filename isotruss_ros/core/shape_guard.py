"""
Keep a robot within the shapes that it can come back from, from sample to sample of a loop.

Barriers hand the program rows, dh/dt >= -fall(h): right to first order, for the instant. A command
holds for an interval, so the guard looks where it leads as well: at the end of the interval each
margin must be above its floor, or the command is scaled down until it is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

from isotruss_ros.core.barriers import (
    Barrier,
    CrossingBarrier,
    Near,
    ObjectBarrier,
    RigidityBarrier,
)
from isotruss_ros.core.boundary import Boundary
from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.grasp import Grasp
from isotruss_ros.core.limits import Rows
from isotruss_ros.core.manipulation import RollerCommand
from isotruss_ros.core.motion import HeldObject
from isotruss_ros.core.robot import Robot
from isotruss_ros.core.status import Status
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Longest steps of the rollers that cannot jump over a band, nor over half of a reserve [m].
BAND_STEP, RESERVE_STEP = 1e-3, 2e-4
#: A command is scaled down this often before the robot stands still, each time with some to spare.
ATTEMPTS, SPARE = 4, 0.8
#: What rounding leaves of a row that depends on no roller, and what keeps a share finite.
NOISE, TINY = 1e-10, 1e-15


@dataclass(frozen=True)
class ShapeBounds:
    """
    What a shape must keep.

    :ivar min_rigidity: the least rigidity, as a share of that at home; see `shape_rigidity`.
    :ivar min_clearance: the least distance between parts of the robot, see `clearance` [m].
    :ivar min_object_clearance: that between the robot and the object, beside the grip [m].
    """

    min_rigidity: float = 0.2
    min_clearance: float = 0.02
    min_object_clearance: float = 0.02


class ShapeGuard:
    """
    The barriers of a robot.

    :param robot: the robot.
    :param bounds: what its shapes must keep.
    """

    def __init__(self, robot: Robot, bounds: ShapeBounds) -> None:
        self._barriers: tuple[Barrier, ...] = (
            RigidityBarrier(robot, Boundary(bounds.min_rigidity, 0.2)),
            CrossingBarrier(robot, Boundary(bounds.min_clearance, 0.1)),
            ObjectBarrier(robot, Boundary(bounds.min_object_clearance, 0.1)),
        )

    def watch(self, config: Configuration, grasp: Grasp) -> Watch:
        """
        Look what is near its bound.

        :param config: where the robot is in the middle of the interval that a command is for.
        :param grasp: what it holds then.
        :raises ConfigurationError: the configuration is singular.
        :raises GraspError: see `grasp_rows`.
        """
        near = [(barrier, barrier.near(config, grasp)) for barrier in self._barriers]
        near = [(barrier, found) for barrier, found in near if len(found.which)]
        limits: list[BarrierLimit] = []
        if near:
            rows = config.module_rows(np.concatenate([found.node_rows for _, found in near]))
            rows = rows[:, config.robot.layout.driven]
            rows[np.abs(rows) < NOISE] = 0.0
            stop = 0
            for barrier, found in near:
                start, stop = stop, stop + len(found.which)
                limits.append(BarrierLimit(barrier, found, rows[start:stop]))
        return Watch(config, grasp, self._barriers, tuple(limits))


class BarrierLimit:
    """
    What is near one barrier in one configuration, as a limit on the rollers.

    :ivar barrier: the barrier.
    :ivar which: (k,) numbers of the values that are near their bound.
    :ivar matrix: (k, r) their derivatives by roller travel.
    :ivar margins: (k,) what is left of them.
    """

    def __init__(self, barrier: Barrier, near: Near, matrix: Array) -> None:
        self.barrier, self.which, self.matrix = barrier, near.which, matrix
        self.margins = barrier.boundary.margin(near.values)

    @property
    def status(self) -> Status:
        """Return the status of a command that this limit slows."""
        return self.barrier.status

    def rows(self, config: Configuration) -> Rows:
        """Return one row for each value; they hold where they were found."""
        fall = self.barrier.boundary.fall(self.margins)
        return Rows(self.matrix, -fall, np.full(len(fall), np.inf))

    def row_names(self, config: Configuration) -> tuple[str, ...]:
        """Return what the values speak of."""
        return tuple(self.barrier.names(self.which))


class Crossed(NamedTuple):
    """
    What keeps a motion from being admissible.

    :ivar share: of the motion that seems admissible.
    :ivar status: of a command that is slowed by it.
    :ivar names: what would come too near to its bound.
    """

    share: float
    status: Status
    names: tuple[str, ...]


class Watch:
    """
    What is near its bound in one configuration.

    :ivar limits: for `solve_twist`.
    """

    def __init__(
        self,
        config: Configuration,
        grasp: Grasp,
        barriers: tuple[Barrier, ...],
        limits: tuple[BarrierLimit, ...],
    ) -> None:
        self.limits = limits
        self._config, self._grasp = config, grasp
        self._limits = {limit.barrier: limit for limit in limits}
        self._barriers = barriers

    def keep(self, command: RollerCommand, velocities: Array, duration: float) -> RollerCommand:
        """
        Return a command, scaled down where it would lead too near to a bound.

        :param command: for the interval in whose middle the robot was expected.
        :param velocities: (r,) with which it was expected to get to that middle [m/s].
        :param duration: of the interval [s].
        """
        rollers = command.roller_velocities
        size = duration * float(np.abs(rollers).max())
        watched = self._watched(size)
        if size == 0.0 or not watched:
            return command
        share, crossed = 1.0, None
        for _ in range(ATTEMPTS):
            found = self._crossed(watched, share * rollers, velocities, duration)
            if found is None:
                break
            share, crossed = SPARE * share * found.share, found
        else:
            share = 0.0
        return command if crossed is None else _scaled(command, share, crossed)

    def _watched(self, size: float) -> tuple[Barrier, ...]:
        """Return the barriers that a step of this size of the rollers [m] could cross."""
        if size > BAND_STEP:
            return self._barriers
        return tuple(
            limit.barrier
            for limit in self.limits
            if size > RESERVE_STEP or limit.margins.min() < 0.5 * limit.barrier.boundary.reserve
        )

    def _crossed(
        self, watched: tuple[Barrier, ...], rollers: Array, velocities: Array, duration: float
    ) -> Crossed | None:
        """Return what of a motion would not be admissible, None where all is."""
        start = self._config
        way = duration * (rollers - 0.5 * velocities)
        try:
            end = start.moved_to(start.roller_positions + way)
        except ConfigurationError:
            return Crossed(0.5, Status.SLOWED_RIGIDITY, ())
        grasp = self._grasp
        if any(isinstance(barrier, ObjectBarrier) for barrier in watched):
            grasp = HeldObject.attach(start, grasp).grasp_in(end)
        worst: Crossed | None = None
        for barrier in watched:
            left = barrier.boundary.margin(barrier.values(end, grasp))
            share, floor = np.full(len(left), 0.5), np.zeros(len(left))
            limit = self._limits.get(barrier)
            if limit is not None:
                before = limit.margins - 0.5 * duration * (limit.matrix @ velocities)
                floor[limit.which] = barrier.boundary.floor(before, duration)
                share[limit.which] = _share(
                    before - floor[limit.which],
                    duration * (limit.matrix @ rollers),
                    left[limit.which] - before,
                )
            below = np.flatnonzero(left < floor)
            if len(below) and (worst is None or share[below].min() < worst.share):
                names = tuple(barrier.names(below))
                worst = Crossed(float(share[below].min()), barrier.status, names)
        return worst


def _share(room: Array, slope: Array, change: Array) -> Array:
    """
    Return the share of a motion after which margins have fallen by the room that they have.

    A margin is taken for a parabola over the share, of which slope and end are known.

    :param room: not negative.
    :param slope: at the beginning, of the share.
    :param change: at the end.
    """
    root = np.sqrt(np.maximum(slope**2 - 4.0 * (change - slope) * room, 0.0))
    return np.minimum(2.0 * room / np.maximum(root - slope, TINY), 1.0)


def _scaled(command: RollerCommand, share: float, crossed: Crossed) -> RollerCommand:
    bent = command.status in (Status.UNREACHABLE, Status.SLIDING) and share > 0.0
    return replace(
        command,
        roller_velocities=share * command.roller_velocities,
        achieved_twist=share * command.achieved_twist,
        scale=share * command.scale,
        status=command.status if bent else crossed.status,
        limiting=tuple(dict.fromkeys(command.limiting + crossed.names)),
    )
