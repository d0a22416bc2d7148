"""Trajectories of the rollers from messages."""

from __future__ import annotations

from isotruss_ros.core import Robot
from isotruss_ros.core.control.roller_trajectory import RollerTrajectory
from isotruss_ros.core.errors import quote
from isotruss_ros.nodes.conversions.messages import MAX_DISTANCE, MessageError
import numpy as np
from trajectory_msgs.msg import JointTrajectory

#: Longest trajectory: reading takes 20 us for each point, in which the node runs no cycle.
MAX_POINTS = 10_000


def read_roller_trajectory(message: JointTrajectory, robot: Robot) -> RollerTrajectory:
    """
    Return the trajectory of the rollers from positions and times of the points.

    :param message: trajectory of all rollers, in any order.
    :param robot: whose rollers they are.
    :raises MessageError: a roller is missing, unknown or named twice, a point has another number
        of positions, or a number is not finite or out of range.
    :raises ConfigurationError: see `RollerTrajectory`.
    """
    names, points = list(message.joint_names), message.points
    if len(names) != len(set(names)) or set(names) != set(robot.roller_names):
        given = ', '.join(quote(name) for name in names[:20]) or 'none'
        raise MessageError(
            f'trajectory: joint_names: {given}; must be each of {", ".join(robot.roller_names)}'
        )
    if len(points) > MAX_POINTS:
        raise MessageError(f'trajectory: {len(points)} points; must be at most {MAX_POINTS}')
    for number, point in enumerate(points):
        positions = np.asarray(point.positions, dtype=np.float64)
        if positions.shape != (len(names),) or not (np.abs(positions) <= MAX_DISTANCE).all():
            raise MessageError(
                f'trajectory: point {number}: must have {len(names)} positions, '
                f'finite and at most {MAX_DISTANCE:g} m'
            )
    order = [names.index(name) for name in robot.roller_names]
    positions = np.array([point.positions for point in points])[:, order]
    times = [p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in points]
    return RollerTrajectory(robot, positions, times)
