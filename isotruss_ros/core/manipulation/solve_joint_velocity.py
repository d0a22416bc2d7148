# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""From velocities of joints to roller velocities: the basic task of a truss robot, no object."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.manipulation.limit_handling import LimitHandling
from isotruss_ros.core.manipulation.limits import Limit
from isotruss_ros.core.manipulation.solve_twist import carry_out, SCALE
from isotruss_ros.core.manipulation.status import RollerCommand
from isotruss_ros.core.manipulation.task import Reach, working_rollers
from isotruss_ros.core.numerics.arrays import Array, finite_array
from isotruss_ros.core.numerics.blas_threads import single_threaded
import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True, eq=False, repr=False)
class JointCommand(RollerCommand):
    """
    Roller velocities, and the motion of the joints that follows from them; see `RollerCommand`.

    :ivar achieved_twist: (2 k,) vx, vy of k joints in the robot frame [m/s].
    :ivar joints: names of the joints.
    :ivar reachable_dof: number of independent motions of the joints that the working rollers can
        produce.
    """

    joints: tuple[str, ...] = ()

    @property
    def achieved_velocities(self) -> dict[str, Array]:
        """Return the achieved velocities (vx, vy) by joint [m/s]."""
        velocities = self.achieved_twist[: 2 * len(self.joints)].reshape(-1, 2)
        return dict(zip(self.joints, velocities, strict=True))


def check_joint(robot: Mechanism, name: str) -> None:
    """
    Check that a robot has a joint.

    :param robot: the robot.
    :param name: of the joint.
    :raises GraspError: it has no such joint; the text names those it has.
    """
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
    handling: LimitHandling = SCALE,
) -> JointCommand:
    """
    Find the roller velocities of the least cost (11) that move joints with given velocities.

    Velocities that are unreachable are replaced by the closest reachable ones; where limits bind
    they are scaled, or deflected, as in `solve_twist`.

    :param config: configuration of the robot.
    :param velocities: (vx, vy) by joint in the robot frame [m/s]; other joints are free to move.
    :param failed: names of the rollers that have failed and stand still.
    :param limits: limits in place of those of the robot file.
    :param handling: what to do where limits bind.
    :raises GraspError: no such joint, a velocity that is not two finite numbers, none at all, or
        no such roller.
    :raises ConfigurationError: the configuration is singular.
    :raises SolverError: a quadratic program was not solved.
    """
    robot = config.robot
    names = robot.topology.joint_names
    if not velocities:
        raise GraspError(f'velocities: at least one of the joints {", ".join(names)}')
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
    working = working_rollers(robot, frozenset([failed] if isinstance(failed, str) else failed))
    reach = Reach.of(jacobian, working, np.ones(len(jacobian)))
    command = carry_out(config, reach, desired, limits, handling)
    return JointCommand(**vars(command), joints=tuple(velocities))
