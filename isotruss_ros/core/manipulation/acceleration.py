# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Limit of the roller accelerations from one control cycle to the next.

The command is a point on the straight line from the previous to the desired command, as close to
the desired command as the largest change of a roller's speed admits. The line begins at the
command closest to the previous one that fulfils the linear constraints of contacts and limits in
the present configuration. So every point of the line fulfils these constraints.

The desired speeds have corners in time where a limit begins or ceases to bind. There a roller that
accelerated would decelerate in the next cycle. Roller speeds with the same twist that avoid such
reversals replace the command, if there are any within the limits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from isotruss_ros.core.manipulation.limits import Rows
from isotruss_ros.core.manipulation.status import RollerCommand, Status
from isotruss_ros.core.numerics.arrays import Array, Flags
from isotruss_ros.core.numerics.qp import QuadraticProgram, solve_qp
from isotruss_ros.core.numerics.tolerances import ROUNDING
import numpy as np

#: Largest increase of the surface speed of the object relative to that of a roller's speed [-]. It
#: bounds jumps where a limit ends: without it, the object's speed rises by 13 mm/s in a cycle in
#: which the rollers' speeds change by 10 mm/s (nine_member).
SURFACE_ACCELERATION = 0.5
#: Smallest changes of a roller's speed in opposite directions in two successive cycles that count
#: as a reversal, relative to the largest change [-]: 1 mm/s in cycles of 10 ms at 1 m/s^2.
#: While the heading turns at limits (nine_member, 1338 cycles), speeds change back and forth by
#: more than 1 mm/s in 2 cycles; with a third of it in 3, with three times in 6.
REVERSAL_SHARE = 0.1


def limit_acceleration(
    command: RollerCommand,
    previous: Array,
    step: Array,
    change: float,
    find_rows: Callable[[], Rows],
    arm: float | None = None,
) -> RollerCommand:
    """
    Return the command closest to a desired command within a largest change of roller speeds.

    If limits of the configuration require a faster stop than `change` [m/s] admits, each roller
    decelerates by at most `change`. The last `step` is the previous change of the speeds (r,).

    :param find_rows: function that returns the rows of the limits, see `stack_rows`.
    :param arm: factor from angular velocity to the speed of the object's surface [m]; None if no
        object is moved.
    """
    motion, contacts = command.motion, command.contact_rows
    velocities = desired = command.roller_velocities
    surface_rows = motion * (0.0 if arm is None else np.array([[1.0], [1.0], [arm]]))
    top_speed = float(np.linalg.norm(surface_rows.dot(previous))) + SURFACE_ACCELERATION * change
    surface_limited = bool(np.linalg.norm(surface_rows.dot(desired)) > top_speed)
    limited = surface_limited or bool(np.abs(desired - previous).max() > change)
    if not limited and not _reverses(step, desired - previous, change):
        return command
    rows = find_rows()
    moving = (desired != 0.0) | (previous != 0.0)  # failed rollers stand still
    if limited:
        projected = previous - np.linalg.pinv(contacts).dot(contacts.dot(previous))
        start = _nearest(projected, contacts, moving, rows, 0.0 * projected)
        to_start, to_desired = start - previous, desired - start
        changed = to_desired != 0.0
        shares = (np.copysign(change, to_desired) - to_start)[changed] / to_desired[changed]
        share = float(max(min(shares.min(initial=1.0), 1.0), 0.0))
        if surface_limited:
            surface_start, surface_desired = surface_rows.dot(start), surface_rows.dot(desired)
            share = min(share, _surface_share(surface_start, surface_desired, top_speed))
        velocities = limit_change(start + share * to_desired, previous, change)
    if _reverses(step, velocities - previous, change):
        # The closest roller speeds with the same twist and without reversals, if there are any.
        small, next_step = REVERSAL_SHARE * change, velocities - previous
        lower = np.where(step > small, -small, np.minimum(next_step, -change))
        upper = np.where(step < -small, small, np.maximum(next_step, change))
        rates = rows.matrix.dot(velocities)  # a faster stop may be required than is possible
        bounds = Rows(
            np.concatenate([rows.matrix, np.eye(len(next_step))]),
            np.concatenate([np.minimum(rows.lower, rates), previous + lower]),
            np.concatenate([np.maximum(rows.upper, rates), previous + upper]),
        )
        fixed = np.concatenate([motion, contacts])
        velocities = _nearest(velocities, fixed, moving, bounds, velocities)
    twist = motion.dot(velocities)
    achieved = command.achieved_twist.copy()
    achieved[: len(twist)] = twist
    status = Status.ACCELERATING if limited else command.status
    return replace(command, roller_velocities=velocities, achieved_twist=achieved, status=status)


def _reverses(step: Array, next_step: Array, change: float) -> bool:
    """Return whether a roller's speed changes back after its change in the previous cycle."""
    smaller = np.minimum(np.abs(step), np.abs(next_step))
    return bool(((step * next_step < 0.0) & (smaller > REVERSAL_SHARE * change)).any())


def _nearest(speeds: Array, fixed: Array, moving: Flags, rows: Rows, otherwise: Array) -> Array:
    """
    Return the roller speeds (r,) closest to given ones that fulfil all rows, or else `otherwise`.

    The product of `fixed` (k, r) with the speeds does not change, nor do rollers not `moving`.
    """
    if (rows.slack(speeds) >= 0.0).all():
        return speeds
    _, values, right = np.linalg.svd(fixed[:, moving])  # unlike SciPy's, also of empty matrices
    equality = right[: (values > ROUNDING * values.max(initial=0.0)).sum()]
    size, unit = float(np.abs(speeds).max()) or 1.0, np.eye(len(right))
    matrix, room = rows.about(speeds).one_sided()
    target = np.zeros(len(equality))
    change = solve_qp(
        QuadraticProgram(unit, 0.0 * unit[0], matrix[:, moving], room / size, equality, target)
    )
    if change is None:
        return otherwise
    nearest = speeds.copy()
    nearest[moving] += size * change
    return nearest


def _surface_share(start: Array, desired: Array, top: float) -> float:
    """Return the largest fraction (0 to 1) of a change at which the velocity is at most `top`."""
    step = desired - start
    square, slope = float(step.dot(step)), float(step.dot(start))
    if square == 0.0:
        return 1.0
    root = np.sqrt(max(slope * slope + square * (top * top - start.dot(start)), 0.0))
    return min(max((root - slope) / square, 0.0), 1.0)


def limit_change(speeds: Array, previous: Array, change: float) -> Array:
    """Return the speeds after a step of at most `change` toward desired speeds [m/s]."""
    step = speeds - previous
    largest = float(np.abs(step).max())
    return speeds if largest <= change else previous + (change / largest) * step
