# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Limit of the rollers' acceleration: from the command of one cycle to that of the next.

The command moves along a straight line from the previous one towards the one that is asked for,
as far as every roller may change its speed. Both ends keep the contacts and the limits, which are
linear in the speeds, and so does every point between them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from isotruss_ros.core.manipulation.limits import Rows
from isotruss_ros.core.manipulation.status import RollerCommand, Status
from isotruss_ros.core.numerics.arrays import Array
import numpy as np


def limit_acceleration(
    command: RollerCommand, previous: Array, change: float, find_rows: Callable[[], Rows]
) -> RollerCommand:
    """
    Return the command that comes closest to one, with a limited change of every roller speed.

    Where the limits of lengths and shapes ask for a quicker stop, the rollers slow down as quickly
    as they may.

    :param command: that is asked for.
    :param previous: (r,) speeds of the rollers in the cycle before [m/s].
    :param change: the largest change of a speed, positive [m/s].
    :param find_rows: returns the rows of the limits in the configuration of the command, see
        `stack_rows`.
    """
    wanted = command.roller_velocities
    if np.abs(wanted - previous).max() <= change:
        return command
    start = _brake(_keep_contacts(command.contact_rows, previous), find_rows())
    share = _largest_share(start - previous, wanted - start, change)
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


def limit_change(speeds: Array, previous: Array, change: float) -> Array:
    """
    Return the speeds (r,) on the straight line to those asked for, with a limited change [m/s].

    :param speeds: (r,) that are asked for [m/s].
    :param previous: (r,) in the cycle before [m/s].
    :param change: the largest change of a speed, not negative [m/s].
    """
    step = speeds - previous
    largest = float(np.abs(step).max())
    return speeds if largest <= change else previous + (change / largest) * step


def _keep_contacts(rows: Array | None, speeds: Array) -> Array:
    """Return the speeds (r,) nearest to others for which all rows (g, r) are zero [m/s]."""
    if rows is None or not len(rows):
        return speeds
    return speeds - np.linalg.lstsq(rows, rows.dot(speeds), rcond=None)[0]


def _brake(speeds: Array, rows: Rows) -> Array:
    """Return the largest part of speeds (r,) that fulfils all rows [m/s]."""
    rates = rows.matrix.dot(speeds)
    room = np.where(rates > 0.0, rows.upper, rows.lower)
    beyond = np.abs(rates) > np.abs(room)
    return float(np.min(room[beyond] / rates[beyond], initial=1.0)) * speeds


def _largest_share(away: Array, step: Array, change: float) -> float:
    """
    Return the largest share of a step, 0 to 1, with which a sum stays within the change.

    :param away: (r,) the sum without the step.
    :param step: (r,).
    :param change: largest magnitude of the sum, positive.
    """
    moving = step != 0.0
    shares = (np.copysign(change, step[moving]) - away[moving]) / step[moving]
    return float(max(min(shares.min(initial=1.0), 1.0), 0.0))
