# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Roller velocities for given velocities of joints, without an object."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.configuration import Configuration, require_configuration
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.manipulation.limit_handling import LimitHandling
from isotruss_ros.core.manipulation.limits import Limit
from isotruss_ros.core.manipulation.solve_twist import carry_out, SCALING
from isotruss_ros.core.manipulation.status import RollerCommand
from isotruss_ros.core.manipulation.task import Reach, working_rollers
from isotruss_ros.core.numerics.arrays import finite_array
from isotruss_ros.core.numerics.blas_threads import single_threaded
import numpy as np
from numpy.typing import ArrayLike


def check_joint(robot: Mechanism, name: str) -> None:
    """Raise GraspError if a robot has no such joint."""
    names = robot.topology.joint_names
    if name not in names:
        raise GraspError(
            f'joint {name!r}: robot {robot.name} has no such joint; '
            f'its joints are {", ".join(names)}'
        )


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
    require_configuration(config)
    robot = config.robot
    names = robot.topology.joint_names
    if not velocities:
        raise GraspError(f'velocities: none; give one or more, of the joints {", ".join(names)}')
    for joint in velocities:
        check_joint(robot, joint)
    desired = np.concatenate(
        [
            finite_array(velocity, 2, f'the velocity (vx, vy) [m/s] of joint {joint}', GraspError)
            for joint, velocity in velocities.items()
        ]
    )
    nodes = np.array([names.index(joint) for joint in velocities])
    columns = np.stack([2 * nodes, 2 * nodes + 1], axis=1).ravel()
    jacobian = config.roller_rows(np.eye(2 * len(config.points))[columns])
    working = working_rollers(
        robot.topology, frozenset([failed] if isinstance(failed, str) else failed)
    )
    reach = Reach.of(jacobian, working, np.ones(len(jacobian)))
    return carry_out(config, reach, desired, limits, handling)
