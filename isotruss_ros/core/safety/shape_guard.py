# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Keep a robot away from singular and self-colliding configurations, from sample to sample of a loop.

Barriers hand the quadratic program rows, dh/dt >= -class-K bound of h: right to first order, for
the instant. A command holds for a sample, so the guard computes where it leads as well: at the
end of the sample each margin must be above its discrete-time bound, or the command is scaled down
until it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from isotruss_ros.core.errors import ConfigurationError, GraspError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.rolling_grip import roll_object
from isotruss_ros.core.manipulation.status import RollerCommand, Status
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.safety.barrier_law import (
    Barrier,
    BarrierLaw,
    BarrierLimit,
    BarrierViolation,
    EVERYTHING,
)
from isotruss_ros.core.safety.barriers import ObjectBarrier, RigidityBarrier, SelfCollisionBarrier
import numpy as np

#: Longest steps of the rollers that cannot jump over a band, nor over half a safety margin [m].
BAND_STEP, SAFETY_STEP = 1e-3, 2e-4
#: A command is scaled down this often before the robot stands still, each time with some to spare.
ATTEMPTS, SPARE = 4, 0.8
#: What rounding leaves of a row that depends on no roller.
NOISE = 1e-10


@dataclass(frozen=True)
class ShapeBounds:
    """
    What a shape must keep, and how far from there the robot is slowed.

    :raises ConfigurationError: a number is out of its range.
    """

    min_rigidity: float = 0.2  #: least rigidity, as a share of that at home; see `rigidity_index`
    min_clearance: float = 0.02  #: least distance between parts of the robot [m]
    min_object_clearance: float = 0.02  #: between the robot and the object, beside the grip [m]
    rigidity_band: float = 0.2  #: the robot is slowed where less than this is left to the bound
    clearance_band: float = 0.1  #: the same for the distances [m]
    rate: float = 5.0  #: a small margin shrinks by at most this share of itself in a second [1/s]

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
        for name in ('rigidity_band', 'clearance_band', 'rate'):
            value = getattr(self, name)
            if not 0.0 < value < np.inf:
                raise ConfigurationError(f'{name} {value!r}: must be finite, positive')


class ShapeGuard:
    """
    The barriers of a robot.

    :ivar bounds: what its shapes must keep.
    :ivar own: barriers beside rigidity, self-collision and the object.
    :param robot: the robot.
    :param barriers: those beside rigidity, self-collision and the object.
    """

    def __init__(
        self,
        robot: Mechanism,
        bounds: ShapeBounds | None = None,
        barriers: Sequence[Barrier] = (),
    ) -> None:
        bounds = ShapeBounds() if bounds is None else bounds
        self.bounds, self.own = bounds, tuple(barriers)
        rigidity, clearance = bounds.rigidity_band, bounds.clearance_band
        rate = min(bounds.rate, robot.description.braking_rate)
        self._barriers: tuple[Barrier, ...] = (
            RigidityBarrier(robot, BarrierLaw(bounds.min_rigidity, rigidity, rate)),
            SelfCollisionBarrier(robot, BarrierLaw(bounds.min_clearance, clearance, rate)),
            ObjectBarrier(robot, BarrierLaw(bounds.min_object_clearance, clearance, rate)),
            *barriers,
        )
        self._without_object = tuple(each for each in self._barriers if not each.needs_object)

    def watch(self, config: Configuration, grip: Grip | None) -> Watch:
        """
        Find what is near its bound.

        :param config: where the robot is in the middle of the sample that a command is for.
        :param grip: what it holds then; None without an object, of which nothing is kept clear.
        :raises ConfigurationError: the configuration is singular.
        :raises GraspError: see `find_contacts`.
        """
        barriers = self._barriers if grip is not None else self._without_object
        found = [(barrier, barrier.active(config, grip)) for barrier in barriers]
        found = [(barrier, active) for barrier, active in found if len(active.indices)]
        limits: list[BarrierLimit] = []
        if found:
            rows = config.roller_rows(np.concatenate([active.node_rows for _, active in found]))
            stop = 0
            for barrier, active in found:
                start, stop = stop, stop + len(active.indices)
                if active.roller_rows is not None:
                    rows[start:stop] += active.roller_rows
                own = rows[start:stop]
                own[np.abs(own) < NOISE] = 0.0
                limits.append(BarrierLimit(barrier, active, rows[start:stop]))
        return Watch(config, grip, barriers, tuple(limits))


class Watch:
    """
    What is near its bound in one configuration.

    :ivar limits: for `solve_twist`.
    :param config: configuration in the middle of the interval of the command.
    :param grip: the grip there; None without an object.
    :param barriers: those that count.
    """

    def __init__(
        self,
        config: Configuration,
        grip: Grip | None,
        barriers: tuple[Barrier, ...],
        limits: tuple[BarrierLimit, ...],
    ) -> None:
        self.limits = limits
        self._config, self._grasp = config, grip
        self._barriers = barriers

    def keep(self, command: RollerCommand, velocities: Array, duration: float) -> RollerCommand:
        """
        Return a command, scaled down where it would lead too near to a bound.

        :param command: for the sample in whose middle the robot was expected.
        :param velocities: (r,) with which it was expected to get to that middle [m/s].
        :param duration: of the sample [s].
        """
        rollers = command.roller_velocities
        size = duration * float(np.abs(rollers).max())
        limits = self._within_reach(size)
        if size == 0.0 or not (limits or size > BAND_STEP):
            return command
        share, violation = 1.0, None
        for _ in range(ATTEMPTS):
            found = self._violation(limits, share * rollers, velocities, duration)
            if found is None:
                break
            share, violation = SPARE * share * found.share, found
        else:
            share = 0.0
        return command if violation is None else _scaled(command, share, violation)

    def _within_reach(self, size: float) -> tuple[BarrierLimit, ...]:
        """Return the limits that a step of this size of the rollers [m] could violate."""
        return tuple(
            limit
            for limit in self.limits
            if size > SAFETY_STEP or limit.margins.min() < 0.5 * limit.barrier.law.safety_margin
        )

    def _violation(
        self,
        limits: tuple[BarrierLimit, ...],
        rollers: Array,
        velocities: Array,
        duration: float,
    ) -> BarrierViolation | None:
        """Return why a motion is not admissible, None where it is."""
        start, grip = self._config, self._grasp
        travel = duration * rollers
        try:
            end = start.moved_to(start.roller_positions + travel - 0.5 * duration * velocities)
        except ConfigurationError:
            return BarrierViolation(0.5, Status.SLOWED_RIGIDITY, ())
        long = bool(np.abs(travel).max() > BAND_STEP)
        if grip is not None and (long or any(limit.barrier.needs_object for limit in limits)):
            try:
                grip = roll_object(grip, start, end)
            except GraspError:  # a contact is lost on the way there
                return BarrierViolation(0.5, Status.SLOWED_OBJECT, ('the contacts of the grip',))
        found = [limit.violation(end, grip, travel, velocities, duration) for limit in limits]
        if long:
            found += [self._jumped(barrier, end, grip) for barrier in self._barriers]
        return min((one for one in found if one is not None), default=None)

    def _jumped(
        self, barrier: Barrier, end: Configuration, grip: Grip | None
    ) -> BarrierViolation | None:
        """Return what has got beyond a bound from outside of its band."""
        left = barrier.values(end, grip, EVERYTHING) - barrier.law.bound
        for limit in self.limits:
            if limit.barrier is barrier:
                left[limit.indices] = np.inf
        below = np.flatnonzero(left < 0.0)
        if not len(below):
            return None
        return BarrierViolation(0.5, barrier.status, tuple(barrier.names(below)))


def _scaled(command: RollerCommand, share: float, violation: BarrierViolation) -> RollerCommand:
    bent = command.status in (Status.UNREACHABLE, Status.SLIDING) and share > 0.0
    return command.slowed(share, command.status if bent else violation.status, violation.names)
