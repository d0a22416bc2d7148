# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Roller velocities for a twist of the grasped object, or for velocities of joints.

The velocities minimize (11) subject to (20).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
import math

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.face_landing import land_faces
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.manipulation.limit_handling import apply_limits, LimitHandling
from isotruss_ros.core.manipulation.limits import default_limits, Limit, stack_rows
from isotruss_ros.core.manipulation.rolling_grip import roll_object
from isotruss_ros.core.manipulation.rolling_off import roll_off_faces
from isotruss_ros.core.manipulation.status import RollerCommand
from isotruss_ros.core.manipulation.task import find_task, Reach, Task, working_rollers
from isotruss_ros.core.model.pose import check_range
from isotruss_ros.core.model.topology import check_names
from isotruss_ros.core.numerics.argument_kinds import check_kinds
from isotruss_ros.core.numerics.arrays import Array, finite_array, MAX_MAGNITUDE
from isotruss_ros.core.numerics.blas_threads import single_threaded
import numpy as np
from numpy.typing import ArrayLike

#: Name of the limit by `soft_rank` in `RollerCommand.limiting`.
RANK = 'the rank of the task'
#: Default behaviour at limits: scaling.
SCALING = LimitHandling()


@check_kinds
@single_threaded
def solve_twist(
    config: Configuration,
    grip: Grip,
    twist: ArrayLike,
    failed: Collection[str] = (),
    limits: Sequence[Limit] | None = None,
    handling: LimitHandling = SCALING,
    opening_rate: float = 0.0,
    cost: ArrayLike | None = None,
) -> RollerCommand:
    """
    Return the least-cost (11) roller velocities for a twist of the object (20).

    Collisions of the robot with itself or with the object, and singular configurations, are not
    prevented unless `limits` are those of `ShapeGuard.limits`. Forces are not computed.

    Contacts neither slip nor open, and unless an opening rate is given, members do not press more
    or less (a disc at a module keeps the opening angle (14)). Every tube has a constant length
    (13). A twist that is unreachable or would break contacts is replaced by the closest reachable
    one in the norm |v|^2 + |omega d/2|^2; then the status is `UNREACHABLE`. A polygon rolls over
    the end of a face if forces can balance, see `roll_off_faces`; gaps of the grip close slowly,
    see `land_faces`. At binding limits the twist is
    scaled, or with `slide_along_limits` projected on the admissible twists, see `apply_limits`.

    :param config: configuration of the robot.
    :param grip: the object and its grasping members.
    :param twist: (3,) vx, vy [m/s], omega [rad/s] of the object in the robot frame.
    :param failed: names of failed rollers, which do not move.
    :param limits: limits that replace those of the robot file; None: the limits of the file.
    :param handling: behaviour at binding limits.
    :param opening_rate: rate of the distance between the contacts of two members, or twice the
        speed of each of three members away from the object [m/s]. It is the right-hand side of the
        fourth row of (19), and is scaled with the twist. With `slide_along_limits`, only limits of
        roller speed scale it; if the other limits do not admit it, it is set to zero.
    :param cost: (r, r) positive definite matrix J of (11) for the roller speeds; None: the paper's
        cost, which is the squared rate of the member lengths. A cost W of the node velocities is
        `rows.T @ W @ rows` with `rows = config.roller_rows(np.eye(len(W)))`.
    :raises GraspError: the grip, the twist, the cost or a name in `failed` is invalid.
    :raises ConfigurationError: the configuration is singular.
    :raises SolverError: a quadratic program was not solved.
    """
    desired = np.asarray(twist)
    usable = desired.dtype == float and desired.shape == (3,)
    if not (usable and all(map(math.isfinite, desired.tolist()))):
        desired = finite_array(twist, 3, 'the twist (vx, vy [m/s], omega [rad/s])', GraspError)
    weights = np.array([1.0, 1.0, grip.body.arm])
    reach = _find_reach(config, grip_jacobian(config, grip), weights, failed)
    if cost is not None:
        reach = reach._replace(working=reach.working.with_cost(cost))
    if len(reach.directions) < 3 and desired.any():
        reach = roll_off_faces(config, grip, reach, desired)
    task = find_task(reach, desired, opening_rate, handling.soft_rank)
    if grip.gaps and len(reach.directions) == 3:
        reach = land_faces(config, grip, reach, task.velocities)
        if reach is not task.reach:
            task = find_task(reach, desired, opening_rate, handling.soft_rank)
    return _carry_out(config, task, limits, handling)


def _find_reach(
    config: Configuration, jacobian: Array, weights: Array, failed: Collection[str]
) -> Reach:
    """Return the twists that are reachable if some rollers have failed, see `Reach.of`."""
    names = frozenset([failed] if isinstance(failed, str) else failed)
    return Reach.of(jacobian, working_rollers(config.robot.topology, names), weights)


def _carry_out(
    config: Configuration, task: Task, limits: Sequence[Limit] | None, handling: LimitHandling
) -> RollerCommand:
    """Return the least-cost (11) command under limits for a twist or joint velocities."""
    speeds, scale, status, reach = task.velocities, 1.0, task.status, task.reach
    limiting: tuple[str, ...] = ()
    limits = default_limits(config.robot) if limits is None else limits
    rows = stack_rows(config, limits)
    rates = rows.matrix.dot(speeds)
    if not ((rates <= rows.upper) & (rates >= rows.lower)).all():
        speeds, scale, status, limiting = apply_limits(config, task, limits, rows, handling)
    if task.share < 1.0:
        scale, limiting = task.share * scale, (*limiting, RANK)
    achieved, dof = reach.motion.dot(speeds), len(reach.directions)
    contact_end = dof + len(reach.opening)
    contacts = reach.working.spread(reach.rows[dof:contact_end])
    return RollerCommand(speeds, achieved, scale, status, limiting, dof, reach.motion, contacts)


@check_kinds
def solve_twist_ahead(
    config: Configuration,
    grip: Grip,
    twist: ArrayLike,
    lead: float,
    failed: Collection[str] = (),
    limits: Sequence[Limit] | None = None,
    handling: LimitHandling = SCALING,
) -> RollerCommand:
    """
    Return the roller velocities computed for the configuration predicted `lead` seconds ahead.

    If `lead` is the age of the measurement plus half of the time for which the command is valid,
    this is the explicit midpoint rule, and the local error is of third order instead of second.

    :param config: configuration of the robot.
    :param grip: the object and its grasping members.
    :param twist: (3,) vx, vy [m/s], omega [rad/s] of the object in the robot frame.
    :param lead: time by which the configuration is predicted, not negative [s].
    :param failed: names of failed rollers, which stand still.
    :param limits: limits that replace those of the robot file; None: the limits of the file.
    :param handling: behaviour at binding limits.
    :raises GraspError: see `solve_twist`; or lead is negative or not finite.
    :raises ConfigurationError: see `solve_twist`, or no predicted configuration exists.
    :raises SolverError: a quadratic program was not solved.
    """
    check_range(lead, 'lead', 's', 0.0, MAX_MAGNITUDE)
    command = solve_twist(config, grip, twist, failed, limits, handling)
    if lead == 0.0 or not command.roller_velocities.any():
        return command
    predicted = config.moved_to(config.roller_positions + lead * command.roller_velocities)
    rolled = roll_object(grip, config, predicted)
    return solve_twist(predicted, rolled, twist, failed, limits, handling)


@check_kinds
@single_threaded
def reachable_twists(config: Configuration, grip: Grip, failed: Collection[str] = ()) -> Array:
    """
    Return a basis of the object's twists that working rollers can produce without losing contacts.

    :param config: configuration of the robot.
    :param grip: the object and its grasping members.
    :param failed: names of failed rollers, which stand still.
    :return: (k, 3) twists vx, vy [m/s], omega [rad/s] in the robot frame, orthonormal in the norm
        |v|^2 + |omega d/2|^2.
    :raises GraspError: the grip or a name in `failed` is invalid.
    :raises ConfigurationError: the configuration is singular.
    """
    weights = np.array([1.0, 1.0, grip.body.arm])
    return _find_reach(config, grip_jacobian(config, grip), weights, failed).directions / weights


@check_kinds
@single_threaded
def solve_joint_velocity(
    config: Configuration,
    velocities: Mapping[str, ArrayLike],
    failed: Collection[str] = (),
    limits: Sequence[Limit] | None = None,
    handling: LimitHandling = SCALING,
) -> RollerCommand:
    """
    Return the least-cost (11) roller velocities for given velocities of joints.

    Unreachable velocities are replaced by the closest reachable velocities. At binding limits,
    velocities are scaled or projected, as in `solve_twist`.

    :param config: configuration of the robot.
    :param velocities: velocity (vx, vy) of each commanded joint in the robot frame, by the joint's
        name [m/s]; the other joints may move in any way.
    :param failed: names of failed rollers, which do not move.
    :param limits: limits that replace those of the robot file; None: the limits of the file.
    :param handling: behaviour at binding limits.
    :return: command; `achieved_twist` has the velocities vx, vy of the joints in the order of
        `velocities`, (2 k,) [m/s], and `reachable_dof` is the number of independent motions of
        the joints.
    :raises GraspError: the robot has no such joint or roller, no velocity is given, or a velocity
        is not two finite numbers.
    :raises ConfigurationError: the configuration is singular.
    :raises SolverError: a quadratic program was not solved.
    """
    names = config.robot.topology.joint_names
    if not velocities:
        raise GraspError(f'velocities: none; give one or more, of the joints {", ".join(names)}')
    check_names('joint', velocities, names, config.robot.name)
    what = 'the velocity (vx, vy) [m/s] of joint '
    pairs = [finite_array(velocities[name], 2, what + name, GraspError) for name in velocities]
    # The joints are the first nodes; their coordinates are x and y one after the other.
    coordinates = [2 * names.index(joint) + axis for joint in velocities for axis in (0, 1)]
    jacobian = config.roller_rows(np.eye(2 * len(config.points))[coordinates])
    reach = _find_reach(config, jacobian, np.ones(len(jacobian)), failed)
    task = find_task(reach, np.concatenate(pairs), soft_rank=handling.soft_rank)
    return _carry_out(config, task, limits, handling)
