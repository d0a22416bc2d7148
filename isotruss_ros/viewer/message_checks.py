# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of the messages that a picture shows, whoever published them or wrote them to a file."""

from __future__ import annotations

import math
from typing import Any

from isotruss_ros.core import IsotrussError, Pose, Status
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Namespaces of the markers of grasp_analysis that are drawn.
DEFORMED, REGIONS, FORCES = 'deformed', 'contact_regions', 'contact_forces'
#: Points of a marker come in groups of so many: two triangles for each step of a region, the two
#: ends of an arrow.
GROUPS = {DEFORMED: 1, REGIONS: 6, FORCES: 2}
#: Codes of a grasp from which on it has no results.
NO_RESULT = 10
#: Beyond every robot and object [m].
FAR = 1e4


class PictureError(IsotrussError, ValueError):
    """A message cannot be shown."""


def read_travel(message: Any, names: tuple[str, ...]) -> dict[str, float]:
    """
    Return the travel of the rollers that a message names [m].

    :param message: sensor_msgs/JointState, of all rollers, some, or none.
    :param names: of the rollers.
    :raises PictureError: there are not as many positions as names, or one is no distance.
    """
    if len(message.name) != len(message.position):
        raise PictureError(
            f'joint states: {len(message.position)} positions for {len(message.name)} names'
        )
    measured = dict(zip(message.name, map(float, message.position), strict=True))
    travel = {name: measured[name] for name in names if name in measured}
    for name, value in travel.items():
        if not abs(value) <= FAR:  # nor for NaN
            raise PictureError(f'joint states: {name} at {value} m')
    return travel


def read_pose(message: Any) -> Pose:
    """
    Return the pose of a message in the robot's frame.

    :param message: geometry_msgs/PoseStamped.
    """
    position, q = message.pose.position, message.pose.orientation
    return Pose(float(position.x), float(position.y), 2.0 * math.atan2(q.z, q.w))


def check_pose(pose: Pose) -> None:
    """
    Refuse a pose that is none.

    :param pose: in the robot's frame.
    :raises PictureError: a number is not finite, or far beyond every robot.
    """
    if not all(abs(value) <= FAR for value in pose):  # nor for NaN
        raise PictureError(f'object pose: {tuple(pose)}')


def check_state(message: Any, members: int) -> None:
    """
    Refuse an analysis that does not belong to the robot.

    :param message: isotruss_msgs/GraspState.
    :param members: number of members of the robot.
    :raises PictureError: not as many utilisations as members, or no direction of the slip margin.
    """
    used = np.asarray(message.utilisation, dtype=float)
    if message.code < NO_RESULT and (len(used) != members or np.isnan(used).any()):
        raise PictureError(f'grasp state: utilisation of {len(used)} members: must be {members}')
    if len(message.slip_direction) != 3:
        raise PictureError(f'grasp state: slip direction of {len(message.slip_direction)} numbers')


def check_status(message: Any) -> None:
    """
    Refuse a status that there is not.

    :param message: isotruss_msgs/ManipulationStatus.
    :raises PictureError: an unknown code.
    """
    if message.code not in tuple(Status):
        raise PictureError(f'manipulation status: code {message.code}')


def read_line(marker: Any) -> Array:
    """
    Return the points (k, 3) of a marker [m].

    :param marker: visualization_msgs/Marker of one of the namespaces of `GROUPS`.
    :raises PictureError: a point is no place, there is no whole number of groups, or a line has
        no length.
    """
    points = np.array([(p.x, p.y, p.z) for p in marker.points], dtype=float).reshape(-1, 3)
    what = f'markers: {marker.ns} {marker.id}'
    if not (np.abs(points) <= FAR).all():
        raise PictureError(f'{what}: a point is not finite, or beyond {FAR:g} m')
    if len(points) % GROUPS[marker.ns]:
        raise PictureError(f'{what}: {len(points)} points: must be groups of {GROUPS[marker.ns]}')
    if marker.ns == DEFORMED and not np.linalg.norm(np.diff(points, axis=0), axis=1).any():
        raise PictureError(f'{what}: a line without length')
    return points
