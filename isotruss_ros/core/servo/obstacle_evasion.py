# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Evasion of moving obstacles by the least change of a command.

The barriers bound the rates of the distances by roller travel, including the velocities of the
obstacles. If a command violates such a bound because an obstacle approaches, the change v of the
roller speeds minimises the change of the twist and the cost (11) under all limits, with constant
contacts; see `least_deviation`. If the limits admit no such change, or a moving obstacle touches,
the rollers stop. The velocity of an obstacle whose messages have none follows from its poses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from isotruss_ros.core.errors import SolverError
from isotruss_ros.core.inputs import Input, InputError, InputFault, require_accepted
from isotruss_ros.core.manipulation.limit_handling import least_deviation, PROGRESS_WEIGHT
from isotruss_ros.core.manipulation.limits import Limit, Rows, stack_rows
from isotruss_ros.core.manipulation.status import RollerCommand, Status
from isotruss_ros.core.manipulation.task import working_rollers
from isotruss_ros.core.model.obstacle import MAX_SPEED, MAX_TURN_RATE, Obstacle
from isotruss_ros.core.model.pose import pose_difference
from isotruss_ros.core.numerics.tolerances import ROUNDING
from isotruss_ros.core.safety.barrier_law import BarrierLimit
from isotruss_ros.core.safety.command_watch import Watch
from isotruss_ros.core.servo.decision import HaltError
from isotruss_ros.core.servo.servo_settings import ServoSettings
import numpy as np

#: Clearance below its bound that is reported [m].
REPORTED_SHORTFALL = 1e-4
#: Time over which the velocity of an obstacle is the mean of its motion [s]. With a pose error of
#: 1 mm it errs by 14 mm/s; a third of it would err by 42 mm/s, three times of it would follow a
#: hand that begins to move 0.3 s late.
TRACKED_TIME = 0.1
#: Largest age of obstacles that end a halt by stale ones, in timeouts [-], so that messages whose
#: age is about the timeout do not alternate between motion and halt.
RESUMED_SHARE = 0.5


@dataclass(frozen=True)
class ObstacleTracks:
    """
    Poses of moving obstacles in their last messages.

    :ivar samples: poses of each obstacle over `TRACKED_TIME`, oldest first.
    :ivar are_stale: whether the last cycle halted for an obstacle that was too old.
    """

    samples: tuple[tuple[Obstacle, ...], ...] = ()
    are_stale: bool = False

    def updated(self, obstacles: Sequence[Obstacle]) -> ObstacleTracks:
        """Return the tracks with the obstacles that are known now; others are discarded."""
        known = {samples[-1].name: samples for samples in self.samples}
        current = [_add_sample(known.get(obstacle.name, ()), obstacle) for obstacle in obstacles]
        return replace(self, samples=tuple(current))

    def predict(self, time: float) -> tuple[Obstacle, ...]:
        """Return the obstacles with their velocities, at their poses at a time [s]."""
        return tuple(_with_velocity(samples).at(time) for samples in self.samples)


def _add_sample(samples: tuple[Obstacle, ...], obstacle: Obstacle) -> tuple[Obstacle, ...]:
    """Return the samples of an obstacle with a new one; after a jump, the new one alone."""
    if not samples or samples[-1].body.shape != obstacle.body.shape:
        return (obstacle,)
    elapsed = obstacle.stamp - samples[-1].stamp
    if elapsed == 0.0:
        return samples
    moved = abs(obstacle.body.center - samples[-1].body.center)
    if elapsed < 0.0 or moved > MAX_SPEED * elapsed:
        return (obstacle,)
    begin = obstacle.stamp - TRACKED_TIME
    later = tuple(sample for sample in samples if sample.stamp > begin)
    # The last sample before this time as well, so that the mean is over all of it.
    first = max(len(samples) - len(later) - 1, 0)
    return (*samples[first:], obstacle)


def _with_velocity(samples: tuple[Obstacle, ...]) -> Obstacle:
    """Return the last sample; a velocity of zero is replaced by that of its poses."""
    first, last = samples[0], samples[-1]
    if any(last.velocity) or first is last:
        return last
    change = pose_difference(last.body.pose, first.body.pose)
    velocity = np.array(change) / (last.stamp - first.stamp)
    velocity[2] = np.clip(velocity[2], -MAX_TURN_RATE, MAX_TURN_RATE)
    return replace(last, velocity=tuple(velocity.tolist()))


def require_obstacles(
    given: Input, tracks: ObstacleTracks, settings: ServoSettings, now: float
) -> tuple[Obstacle, ...]:
    """Return the moving obstacles of the last messages; raise InputError for a silent one."""
    received = require_accepted('obstacles', given)
    if received is None:
        return ()
    oldest = settings.obstacle_timeout * (RESUMED_SHARE if tracks.are_stale else 1.0)
    for obstacle in received.value:
        age = now - obstacle.stamp
        if age > oldest:
            rejected = '' if received.rejected is None else f': {received.rejected.reason}'
            words = f'must be at most {oldest:g} s, or cleared{rejected}'
            message = f'moving obstacle {obstacle.name}: {age:.3f} s old; {words}'
            raise InputError(InputFault.STALE, 'obstacles', message)
    return tuple(received.value)


def evade(
    command: RollerCommand, watch: Watch, limits: Sequence[Limit], failed: frozenset[str]
) -> tuple[RollerCommand, str]:
    """
    Return the command by which robot and object evade obstacles, and a note on obstacles.

    :param limits: all limits on the command, those of `watch` last.
    :raises HaltError: the limits do not admit an evasion.
    """
    obstacles = [limit for limit in watch.limits if limit.status is Status.SLOWED_OBSTACLE]
    if not obstacles:
        return command, ''
    note, nearest = '', min(obstacles, key=lambda limit: limit.margins.min())
    place = int(nearest.margins.argmin())
    if nearest.margins[place] < -REPORTED_SHORTFALL:
        note = describe_shortfall(nearest, place)
        if nearest.margins[place] + nearest.barrier.law.bound <= 0.0 < nearest.required[place]:
            raise HaltError(Status.HALT_OBSTACLE, note)
    speeds, names = command.roller_velocities, list[str]()
    for limit in obstacles:
        # The command fulfils the bounds that are not positive.
        required = limit.required
        if required.max() > 0.0:
            is_short = (required > 0.0) & (limit.matrix @ speeds < required - ROUNDING)
            names += limit.barrier.names(limit.indices[is_short])
    if not names:
        return command, note
    # Rows of all limits; rates of distances are bounded with the velocities of the obstacles.
    rows, unit = stack_rows(watch.config, limits), watch.config.robot.description.max_speed
    required = np.concatenate([limit.required for limit in watch.limits])
    lower = np.concatenate([rows.lower[: -len(required)], required])
    working = working_rollers(watch.config.robot.topology, failed)
    bounds = Rows(rows.matrix, lower, rows.upper).about(speeds)
    matrix = bounds.matrix.take(working.indices, -1)
    scaled = Rows(matrix, bounds.lower / unit, bounds.upper / unit)
    task_rows = np.concatenate([command.motion, command.contact_rows]).take(working.indices, -1)
    dof, contacts = len(command.motion), np.zeros(len(command.contact_rows))
    try:
        change = least_deviation(
            working.cost, task_rows, dof, contacts, scaled, 1.0 / PROGRESS_WEIGHT
        )
    except SolverError:
        words = f'{", ".join(names)}: the obstacle approaches faster than the robot can evade it'
        raise HaltError(Status.HALT_OBSTACLE, '; '.join(filter(None, (words, note)))) from None
    velocities = speeds + unit * working.spread(change)
    achieved = command.achieved_twist.copy()
    achieved[:dof] = command.motion @ velocities
    evading = replace(
        command,
        roller_velocities=velocities,
        achieved_twist=achieved,
        scale=0.0,
        status=Status.SLOWED_OBSTACLE,
        limiting=tuple(dict.fromkeys((*command.limiting, *names))),
    )
    return evading, note


def describe_shortfall(limit: BarrierLimit, place: int) -> str:
    """Return a sentence about a clearance that is smaller than its bound."""
    margin, bound = float(limit.margins[place]), limit.barrier.law.bound
    (name,) = limit.barrier.names(limit.indices[[place]])
    if margin + bound <= 0.0:
        return f'{name}: touch; only motion that separates them is executed'
    return (
        f'{name}: {1e3 * (margin + bound):.1f} mm apart; must be at least {1e3 * bound:g} mm; '
        'only motion that separates them is executed'
    )
