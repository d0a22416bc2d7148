# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Roller velocities for a twist of the grasped object: minimize (11) subject to (20)."""

from __future__ import annotations

from collections.abc import Collection, Sequence
import functools
import math

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.manipulation.limit_handling import apply_limits, LimitHandling
from isotruss_ros.core.manipulation.limits import default_limits, Limit, stack_rows
from isotruss_ros.core.manipulation.rolling_grip import roll_object
from isotruss_ros.core.manipulation.rolling_off import roll_off_faces
from isotruss_ros.core.manipulation.status import RollerCommand
from isotruss_ros.core.manipulation.task import (
    find_task,
    Reach,
    working_rollers,
    WorkingRollers,
)
from isotruss_ros.core.numerics.arrays import Array, finite_array
from isotruss_ros.core.numerics.blas_threads import single_threaded
import numpy as np
from numpy.typing import ArrayLike

#: By default commands are scaled, as far as limits allow.
SCALE = LimitHandling()


@single_threaded
def solve_twist(
    config: Configuration,
    grip: Grip,
    twist: ArrayLike,
    failed: Collection[str] = (),
    limits: Sequence[Limit] | None = None,
    handling: LimitHandling = SCALE,
    opening_rate: float = 0.0,
    cost: ArrayLike | None = None,
) -> RollerCommand:
    """
    Find the roller velocities of the least cost (11) that move the object with a twist (20).

    The object keeps its contacts, with a disc at a module the opening angle (14), unless the
    opening rate is given; every tube keeps its length (13) in all cases. A twist that is
    unreachable, or that would leave the contacts, is replaced by the closest reachable one, in the
    measure |v|^2 + |omega d/2|^2, and the status is `UNREACHABLE`; a polygon rolls off a face for
    it where statics admits that, see `roll_off_faces`. When limits bind, the direction is kept and
    the size scaled; or, with `slide_along_limits`, the closest twist that they admit is carried
    out, see `apply_limits`.

    :param config: configuration of the robot.
    :param grip: the object, and the members that hold it.
    :param twist: (3,) vx, vy [m/s], omega [rad/s] of the object in the robot frame.
    :param failed: names of the rollers that have failed and stand still.
    :param limits: limits in place of those of the robot file.
    :param handling: what to do where limits bind.
    :param opening_rate: of the distance between two members where they touch, of three twice that
        with which each moves away from the object [m/s]: the right-hand side of the fourth row of
        (19), scaled with the twist; while sliding along limits as far as those of the roller
        speeds scale it, and zero where the others do not admit that.
    :param cost: (r, r) J of (11) as a positive definite form of the roller speeds; None for the
        cost of the paper, the squared change of the member lengths. A cost W of the node
        velocities is `rows.T @ W @ rows` with `rows = config.roller_rows(np.eye(len(W)))`.
    :raises GraspError: the grip, the twist, the cost or a name in `failed` is not usable.
    :raises ConfigurationError: the configuration is singular.
    :raises SolverError: a quadratic program was not solved.
    """
    robot = config.robot
    desired = np.asarray(twist)
    usable = desired.dtype == float and desired.shape == (3,)
    if not (usable and all(map(math.isfinite, desired.tolist()))):
        desired = finite_array(twist, 3, 'the twist (vx, vy [m/s], omega [rad/s])', GraspError)
    working = working_rollers(robot, frozenset([failed] if isinstance(failed, str) else failed))
    reach = _find_reach(config, grip, working)
    if cost is not None:
        reach = reach._replace(working=working.with_cost(cost))
    if len(reach.directions) < 3 and desired.any():
        reach = roll_off_faces(config, grip, reach, desired)
    return carry_out(config, reach, desired, limits, handling, opening_rate)


@functools.lru_cache(maxsize=8)
def _find_reach(config: Configuration, grip: Grip, working: WorkingRollers) -> Reach:
    """Return the twists of the object that keep its contacts; the last few results are kept."""
    weights = np.array([1.0, 1.0, grip.body.arm])
    return Reach.of(grip_jacobian(config, grip), working, weights)


def carry_out(
    config: Configuration,
    reach: Reach,
    desired: Array,
    limits: Sequence[Limit] | None,
    handling: LimitHandling,
    opening_rate: float = 0.0,
) -> RollerCommand:
    """
    Find the roller velocities of the least cost (11) for a motion, as far as limits admit.

    :param config: configuration of the robot.
    :param reach: what the working rollers can do.
    :param desired: (k,) what they are to do.
    :param limits: limits of rollers and configuration; None for those of the robot file.
    :param handling: what to do where limits bind.
    :param opening_rate: right-hand side of the grip's row [m/s].
    :raises SolverError: a quadratic program was not solved.
    """
    task = find_task(reach, desired, opening_rate)
    velocities, scale, status = task.velocities, 1.0, task.status
    limiting: tuple[str, ...] = ()
    limits = default_limits(config.robot) if limits is None else limits
    rows = stack_rows(config, limits)
    rates = rows.matrix.dot(velocities)
    if not ((rates <= rows.upper) & (rates >= rows.lower)).all():
        velocities, scale, status, limiting = apply_limits(config, task, limits, rows, handling)
    achieved, dof = reach.motion.dot(velocities), len(reach.directions)
    return RollerCommand(
        velocities, achieved, scale, status, limiting, dof, reach.motion, reach.contact_rows
    )


def solve_twist_ahead(
    config: Configuration,
    grip: Grip,
    twist: ArrayLike,
    lead: float,
    failed: Collection[str] = (),
    limits: Sequence[Limit] | None = None,
    handling: LimitHandling = SCALE,
) -> RollerCommand:
    """
    Find roller velocities for the configuration after `lead` seconds of this motion.

    A command that is held for an interval, computed from a measurement of some age, is exact in
    the middle of the interval: with lead = age of the measurement + half of the interval the error
    of a step falls from second to third order (the explicit midpoint rule).

    :param config: configuration of the robot.
    :param grip: the object, and the members that hold it.
    :param twist: (3,) vx, vy [m/s], omega [rad/s] of the object in the robot frame.
    :param lead: not negative [s].
    :param failed: names of the rollers that have failed and stand still.
    :param limits: limits in place of those of the robot file.
    :param handling: what to do where limits bind.
    :raises GraspError: see `solve_twist`; or lead is negative or not finite.
    :raises ConfigurationError: see `solve_twist`, or there is no such configuration.
    :raises SolverError: a quadratic program was not solved.
    """
    if not (math.isfinite(lead) and lead >= 0.0):
        raise GraspError(f'lead {lead!r} s: must be a finite number, not negative')
    command = solve_twist(config, grip, twist, failed, limits, handling)
    if lead == 0.0 or not command.roller_velocities.any():
        return command
    ahead = config.moved_to(config.roller_positions + lead * command.roller_velocities)
    return solve_twist(ahead, roll_object(grip, config, ahead), twist, failed, limits, handling)


@single_threaded
def reachable_twists(config: Configuration, grip: Grip, failed: Collection[str] = ()) -> Array:
    """
    Return the motions of the object that the working rollers can produce.

    :param config: configuration of the robot.
    :param grip: the object, and the members that hold it.
    :param failed: names of the rollers that have failed and stand still.
    :return: (k, 3) twists vx, vy [m/s], omega [rad/s] in the robot frame, as many as are
        independent, orthonormal in the measure |v|^2 + |omega d/2|^2; the object keeps its
        contacts, and faces that lie on members stay there.
    :raises GraspError: the grip or a name in `failed` is not usable.
    :raises ConfigurationError: the configuration is singular.
    """
    working = working_rollers(config.robot, frozenset(failed))
    reach = _find_reach(config, grip, working)
    return reach.directions / reach.weights
