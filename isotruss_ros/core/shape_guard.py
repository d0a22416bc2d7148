"""
Keep a robot within the shapes that it can come back from, from sample to sample of a loop.

Barriers hand the program rows, dh/dt >= -fall(h): right to first order, for the instant. A command
holds for an interval, so the guard looks where it leads as well: at the end of the interval each
margin must be above its floor, or the command is scaled down until it is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from isotruss_ros.core.barrier_limit import BarrierLimit, Crossed
from isotruss_ros.core.barriers import (
    Barrier,
    CrossingBarrier,
    EVERYTHING,
    ObjectBarrier,
    RigidityBarrier,
)
from isotruss_ros.core.boundary import Boundary
from isotruss_ros.core.clearance import bodies
from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.grasp import Grasp
from isotruss_ros.core.manipulation import RollerCommand
from isotruss_ros.core.motion import HeldObject
from isotruss_ros.core.robot import Robot
from isotruss_ros.core.status import Status
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: How far from their bounds barriers begin to slow the robot: of the rigidity at home, and [m].
RIGIDITY_BAND, CLEARANCE_BAND = 0.2, 0.1
#: Longest steps of the rollers that cannot jump over a band, nor over half of a reserve [m].
BAND_STEP, RESERVE_STEP = 1e-3, 2e-4
#: A command is scaled down this often before the robot stands still, each time with some to spare.
ATTEMPTS, SPARE = 4, 0.8
#: What rounding leaves of a row that depends on no roller.
NOISE = 1e-10


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

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not 0.0 <= self.min_rigidity < 1.0:
            raise ConfigurationError(
                f'min_rigidity {self.min_rigidity!r}: must be a share of that at home, '
                'from 0 to less than 1'
            )
        for name in ('min_clearance', 'min_object_clearance'):
            value = getattr(self, name)
            if not 0.0 <= value < np.inf:
                raise ConfigurationError(f'{name} {value!r} m: must be finite, not negative')


class ShapeGuard:
    """
    The barriers of a robot.

    :ivar bounds: what its shapes must keep.
    :ivar unguarded: pairs of parts that overlap at home, so that they must lie at different
        heights, and are left out.
    :param robot: the robot.
    :param bounds: what its shapes must keep.
    """

    def __init__(self, robot: Robot, bounds: ShapeBounds) -> None:
        self.bounds = bounds
        self.unguarded = bodies(robot).overlapping
        self._barriers: tuple[Barrier, ...] = (
            RigidityBarrier(robot, Boundary(bounds.min_rigidity, RIGIDITY_BAND)),
            CrossingBarrier(robot, Boundary(bounds.min_clearance, CLEARANCE_BAND)),
            ObjectBarrier(robot, Boundary(bounds.min_object_clearance, CLEARANCE_BAND)),
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
        limits = self._watched(size)
        if size == 0.0 or not (limits or size > BAND_STEP):
            return command
        share, crossed = 1.0, None
        for _ in range(ATTEMPTS):
            found = self._crossed(limits, share * rollers, velocities, duration)
            if found is None:
                break
            share, crossed = SPARE * share * found.share, found
        else:
            share = 0.0
        return command if crossed is None else _scaled(command, share, crossed)

    def _watched(self, size: float) -> tuple[BarrierLimit, ...]:
        """Return the limits that a step of this size of the rollers [m] could cross."""
        return tuple(
            limit
            for limit in self.limits
            if size > RESERVE_STEP or limit.margins.min() < 0.5 * limit.barrier.boundary.reserve
        )

    def _crossed(
        self,
        limits: tuple[BarrierLimit, ...],
        rollers: Array,
        velocities: Array,
        duration: float,
    ) -> Crossed | None:
        """Return what of a motion would not be admissible, None where all is."""
        start, grasp = self._config, self._grasp
        way = duration * rollers
        try:
            end = start.moved_to(start.roller_positions + way - 0.5 * duration * velocities)
        except ConfigurationError:
            return Crossed(0.5, Status.SLOWED_RIGIDITY, ())
        long = bool(np.abs(way).max() > BAND_STEP)
        if long or any(isinstance(limit.barrier, ObjectBarrier) for limit in limits):
            grasp = HeldObject.attach(start, grasp).grasp_in(end)
        found = [limit.crossed(end, grasp, way, velocities, duration) for limit in limits]
        if long:
            found += [self._jumped(barrier, end, grasp) for barrier in self._barriers]
        return min((one for one in found if one is not None), default=None)

    def _jumped(self, barrier: Barrier, end: Configuration, grasp: Grasp) -> Crossed | None:
        """Return what has got beyond a bound from outside of its band."""
        left = barrier.boundary.margin(barrier.values(end, grasp, EVERYTHING))
        for limit in self.limits:
            if limit.barrier is barrier:
                left[limit.which] = np.inf
        below = np.flatnonzero(left < 0.0)
        return Crossed(0.5, barrier.status, tuple(barrier.names(below))) if len(below) else None


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
