# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Limit of the roller accelerations from one control cycle to the next.

The command is a point on the straight line from the previous to the desired command, as close to
the desired command as the largest change of a roller's speed admits. Both ends of the line fulfil
the linear constraints of contacts and limits, so every point of the line fulfils these
constraints.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from isotruss_ros.core.manipulation.limits import Rows
from isotruss_ros.core.manipulation.status import RollerCommand, Status
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Largest increase of the surface speed of the object relative to that of a roller's speed [-]. It
#: bounds jumps where a limit ends: without it, the object's speed rises by 13 mm/s in a cycle in
#: which the rollers' speeds change by 10 mm/s (nine_member).
SURFACE_ACCELERATION = 0.5


def limit_acceleration(
    command: RollerCommand,
    previous: Array,
    change: float,
    find_rows: Callable[[], Rows],
    arm: float | None = None,
) -> RollerCommand:
    """
    Return the command closest to a desired command within a largest change of roller speeds.

    If limits of the configuration require a faster stop than `change` admits, each roller
    decelerates by at most `change`.

    :param previous: (r,) roller speeds of the previous cycle [m/s].
    :param change: largest change of a speed, positive [m/s].
    :param find_rows: function that returns the rows of the limits at the command's configuration,
        see `stack_rows`.
    :param arm: factor from angular velocity to the speed of the object's surface [m]; None if no
        object is moved.
    """
    wanted = command.roller_velocities
    if command.motion is None or arm is None:
        weighted = np.zeros((1, len(wanted)))
    else:
        weighted = command.motion * np.array([[1.0], [1.0], [arm]])
    top = float(np.linalg.norm(weighted.dot(previous))) + SURFACE_ACCELERATION * change
    faster = bool(np.linalg.norm(weighted.dot(wanted)) > top)
    if not faster and np.abs(wanted - previous).max() <= change:
        return command
    start = _brake(_keep_contacts(command.contact_rows, previous), find_rows())
    share = _largest_share(start - previous, wanted - start, change)
    if faster:
        share = min(share, _surface_share(weighted.dot(start), weighted.dot(wanted), top))
    velocities = limit_change(start + share * (wanted - start), previous, change)
    achieved = command.achieved_twist.copy()
    if command.motion is not None:
        moved = command.motion.dot(velocities)
        achieved[: len(moved)] = moved
    return replace(
        command,
        roller_velocities=velocities,
        achieved_twist=achieved,
        status=Status.ACCELERATING,
    )


def _surface_share(start: Array, wanted: Array, top: float) -> float:
    """Return the largest fraction (0 to 1) of a change at which the velocity is at most `top`."""
    step = wanted - start
    square, slope = float(step.dot(step)), float(step.dot(start))
    if square == 0.0:
        return 1.0
    root = np.sqrt(max(slope * slope + square * (top * top - start.dot(start)), 0.0))
    return min(max((root - slope) / square, 0.0), 1.0)


def limit_change(speeds: Array, previous: Array, change: float) -> Array:
    """
    Return the speeds (r,) after a step from previous toward desired speeds, limited to `change`.

    :param speeds: (r,) desired speeds [m/s].
    :param previous: (r,) speeds of the previous cycle [m/s].
    :param change: largest change of a speed, not negative [m/s].
    """
    step = speeds - previous
    largest = float(np.abs(step).max())
    return speeds if largest <= change else previous + (change / largest) * step


def _keep_contacts(rows: Array | None, speeds: Array) -> Array:
    """Return roller speeds (r,), projected on the null space of contact constraints (g, r)."""
    if rows is None or not len(rows):
        return speeds
    return speeds - np.linalg.lstsq(rows, rows.dot(speeds), rcond=None)[0]


def _brake(speeds: Array, rows: Rows) -> Array:
    """Return the largest multiple, at most 1, of roller speeds (r,) that fulfils all rows."""
    rates = rows.matrix.dot(speeds)
    room = np.where(rates > 0.0, rows.upper, rows.lower)
    beyond = np.abs(rates) > np.abs(room)
    return float(np.min(room[beyond] / rates[beyond], initial=1.0)) * speeds


def _largest_share(away: Array, step: Array, change: float) -> float:
    """
    Return the largest fraction of a step, 0 to 1, at which all values are within a bound.

    :param away: (r,) values without the step.
    :param step: (r,) change of the values by the whole step.
    """
    moving = step != 0.0
    shares = (np.copysign(change, step[moving]) - away[moving]) / step[moving]
    return float(max(min(shares.min(initial=1.0), 1.0), 0.0))
