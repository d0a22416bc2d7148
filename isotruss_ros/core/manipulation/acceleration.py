# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Limits of the accelerations of rollers and object from one control cycle to the next.

The command is a point on the straight line from the previous to the desired command, as close to
the desired command as the largest changes of a roller's speed and of the object's velocity admit.
Rollers that change by 10 mm/s alone may change the velocity of the object by more than 20 mm/s
(nine_member near the limits of its configuration). The line begins at the
command closest to the previous one that fulfils the linear constraints of contacts and limits in
the present configuration. So every point of the line fulfils these constraints.

The desired speeds have corners in time where a limit begins or ceases to bind. There a roller that
accelerated would decelerate in the next cycle. Roller speeds with the same twist that avoid such
reversals replace the command, if there are any within the limits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import math

from isotruss_ros.core.manipulation.limits import Rows
from isotruss_ros.core.manipulation.status import RollerCommand, Status
from isotruss_ros.core.numerics.arrays import Array, Flags
from isotruss_ros.core.numerics.qp import QuadraticProgram, solve_qp
from isotruss_ros.core.numerics.tolerances import ROUNDING
import numpy as np

#: Smallest change toward the desired command, relative to the largest one of the object's velocity
#: [-]. Near singular configurations, constant roller speeds change the velocity by up to 5 mm/s in
#: 10 ms at 50 mm/s; without this share, the object would not stop there.
MIN_DESIRED_SHARE = 0.2
#: Smallest changes of a roller's speed in opposite directions in two successive cycles that count
#: as a reversal, relative to the largest change [-]: 1 mm/s in cycles of 10 ms at 1 m/s^2.
#: While the heading turns at limits (nine_member, 1338 cycles), speeds change back and forth by
#: more than 1 mm/s in 2 cycles; with a third of it in 3, with three times in 6.
REVERSAL_SHARE = 0.1


def limit_acceleration(
    command: RollerCommand,
    previous: Array,
    previous_change: Array,
    max_change: float,
    find_rows: Callable[[], Rows],
    arm: float | None = None,
    max_object_change: float = math.inf,
    velocity: Array | None = None,
) -> RollerCommand:
    """
    Return the command closest to a desired command within largest changes of the speeds.

    If limits of the configuration require a faster stop than `max_change` [m/s] admits, each
    roller decelerates by at most `max_change`; the object then decelerates with them. `previous`
    has the roller speeds (r,) of the previous cycle, and `previous_change` their change in that
    cycle.

    :param find_rows: function that returns the rows of the limits, see `stack_rows`.
    :param arm: factor from angular velocity to the speed of the object's surface [m]; None if no
        object is moved.
    :param max_object_change: largest change of the velocity of the object [m/s], in the norm
        |v|^2 + |omega arm|^2. It is exceeded if roller speeds that stay constant, or fulfil the
        limits, change this velocity by nearly as much; see `MIN_DESIRED_SHARE`.
    :param velocity: (3,) twist of the object in the previous cycle; None: that which `previous`
        would produce in the present configuration.
    """
    motion, contacts = command.motion, command.contact_rows
    velocities = desired = command.roller_velocities

    # Rows of the object's velocity, zero if no object is moved.
    weights = np.zeros(len(motion)) if arm is None else np.array([1.0, 1.0, arm])
    object_rows = weights[:, None] * motion
    before = object_rows.dot(previous) if velocity is None else weights * velocity[: len(weights)]
    change = desired - previous
    limited = bool(np.abs(change).max() > max_change)
    limited |= bool(np.linalg.norm(object_rows.dot(desired) - before) > max_object_change)
    if not limited and not _reverses(previous_change, change, max_change):
        return command
    rows = find_rows()
    moving = (desired != 0.0) | (previous != 0.0)  # failed rollers stand still
    if limited:
        # A line from the speeds closest to the previous ones that fulfil the constraints.
        projected = previous - np.linalg.pinv(contacts).dot(contacts.dot(previous))
        start = _nearest(projected, contacts, moving, rows, 0.0 * projected)
        # The largest share s of the line with |start + s * line - previous| <= max_change.
        line, differs = desired - start, desired != start
        room = np.copysign(max_change, line) - (start - previous)
        share = max(float((room[differs] / line[differs]).min(initial=1.0)), 0.0)
        object_start = object_rows.dot(start) - before
        least = float(np.linalg.norm(object_start)) + MIN_DESIRED_SHARE * max_object_change
        radius = max(max_object_change, least)
        share = min(share, _share_within(object_start, object_rows.dot(line), radius))
        # Even the start may require too large an acceleration.
        velocities = limit_change(start + share * line, previous, max_change)
    if _reverses(previous_change, velocities - previous, max_change):
        no_reversals = _reversal_rows(rows, velocities, previous, previous_change, max_change)
        same_twist = np.concatenate([motion, contacts])
        velocities = _nearest(velocities, same_twist, moving, no_reversals, velocities)
    # A command for joints has two components for each joint, a twist has three.
    twist = motion.dot(velocities)
    achieved = command.achieved_twist.copy()
    achieved[: len(twist)] = twist
    status = Status.ACCELERATING if limited else command.status
    return replace(command, roller_velocities=velocities, achieved_twist=achieved, status=status)


def _reverses(previous_change: Array, change: Array, max_change: float) -> bool:
    """Return whether a roller accelerates and then decelerates in two cycles, or vice versa."""
    smaller = np.minimum(np.abs(previous_change), np.abs(change))
    is_opposite = previous_change * change < 0.0
    return bool((is_opposite & (smaller > REVERSAL_SHARE * max_change)).any())


def _reversal_rows(
    rows: Rows, velocities: Array, previous: Array, previous_change: Array, max_change: float
) -> Rows:
    """Return the rows of the limits, and of roller speeds without reversals."""
    # A roller that accelerated may decelerate only a little, and vice versa. Otherwise its change
    # is at most `max_change`, or that of the present velocities.
    change, small = velocities - previous, REVERSAL_SHARE * max_change
    lower = np.where(previous_change > small, -small, np.minimum(change, -max_change))
    upper = np.where(previous_change < -small, small, np.maximum(change, max_change))
    # A limit that the velocities violate, because they cannot stop as fast, is extended to them.
    rates = rows.matrix.dot(velocities)
    return Rows(
        np.concatenate([rows.matrix, np.eye(len(change))]),
        np.concatenate([np.minimum(rows.lower, rates), previous + lower]),
        np.concatenate([np.maximum(rows.upper, rates), previous + upper]),
    )


def _nearest(speeds: Array, fixed: Array, moving: Flags, rows: Rows, otherwise: Array) -> Array:
    """
    Return the roller speeds (r,) closest to given ones that fulfil all rows, or else `otherwise`.

    The product of `fixed` (k, r) with the speeds does not change, nor do rollers not `moving`.
    """
    if (rows.slack(speeds) >= 0.0).all():
        return speeds
    # Independent rows of `fixed`; unlike SciPy, NumPy decomposes also empty matrices.
    _, values, basis = np.linalg.svd(fixed[:, moving])
    equality = basis[: (values > ROUNDING * values.max(initial=0.0)).sum()]
    # Least squares of the changes of the moving rollers' speeds, in units of the largest speed.
    unit = float(np.abs(speeds).max()) or 1.0
    matrix, room = rows.about(speeds).one_sided()
    hessian, gradient = np.eye(len(basis)), np.zeros(len(basis))
    bounds, target = (matrix[:, moving], room / unit), np.zeros(len(equality))
    change = solve_qp(QuadraticProgram(hessian, gradient, *bounds, equality, target))
    if change is None:
        return otherwise
    nearest = speeds.copy()
    nearest[moving] += unit * change
    return nearest


def _share_within(start: Array, line: Array, radius: float) -> float:
    """Return the largest s from 0 to 1 with |start + s line| <= radius, for |start| <= radius."""
    square, slope = float(line.dot(line)), float(line.dot(start))
    if square == 0.0 or math.isinf(radius):
        return 1.0
    root = math.sqrt(max(slope * slope + square * (radius * radius - start.dot(start)), 0.0))
    return min(max((root - slope) / square, 0.0), 1.0)


def limit_change(speeds: Array, previous: Array, change: float) -> Array:
    """Return the speeds after a step of at most `change` toward desired speeds [m/s]."""
    step = speeds - previous
    largest = float(np.abs(step).max())
    return speeds if largest <= change else previous + (change / largest) * step
