# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of messages before they are displayed, as they may come from any publisher or file."""

from __future__ import annotations

import math
from typing import Any

from isotruss_ros.core import IsotrussError, Pose, Status
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Namespaces of grasp_analysis's markers that are drawn.
DEFORMED, REGIONS, FORCES = 'deformed', 'contact_regions', 'contact_forces'
#: Number that divides the number of points of a marker, for each namespace: six points are two
#: triangles of a contact region, two points are the ends of an arrow.
GROUPS = {DEFORMED: 1, REGIONS: 6, FORCES: 2}
#: Smallest status code of a grasp analysis without result.
MIN_CODE_WITHOUT_RESULT = 10
#: Value of the field `held` of a grasp analysis without result.
HELD_UNKNOWN = 2
#: Largest valid coordinate [m].
MAX_DISTANCE = 1e4


class PictureError(IsotrussError, ValueError):
    """Error: a message cannot be displayed."""


def read_travel(message: Any, names: tuple[str, ...]) -> dict[str, float]:
    """Return the travel for the name of each roller in a message [m]."""
    if len(message.name) != len(message.position):
        raise PictureError(
            f'joint states: {len(message.position)} positions for {len(message.name)} names; '
            'must be as many'
        )
    measured = dict(zip(message.name, map(float, message.position), strict=True))
    travel = {name: measured[name] for name in names if name in measured}
    for name, value in travel.items():
        if not abs(value) <= MAX_DISTANCE:  # excludes NaN
            raise PictureError(
                f'joint states: {name} at {value} m: must be finite, at most {MAX_DISTANCE:g} m'
            )
    return travel


def read_pose(message: Any) -> Pose:
    """Return the pose of a message in the robot frame."""
    position, q = message.pose.position, message.pose.orientation
    return Pose(float(position.x), float(position.y), 2.0 * math.atan2(q.z, q.w))


def check_pose(pose: Pose) -> None:
    """
    Raise PictureError if a pose is invalid.

    :param pose: pose in the robot frame.
    """
    if not all(abs(value) <= MAX_DISTANCE for value in pose):  # excludes NaN
        raise PictureError(
            f'object pose {tuple(pose)}: must be finite, at most {MAX_DISTANCE:g} m'
        )


def check_state(message: Any, members: int) -> None:
    """
    Raise PictureError if a grasp analysis belongs to another robot.

    :param message: isotruss_msgs/GraspState; an unknown utilisation is None.
    """
    if message.code < MIN_CODE_WITHOUT_RESULT and message.utilisation is not None:
        used = np.asarray(message.utilisation, dtype=float)
        if len(used) not in (0, members) or np.isnan(used).any():
            raise PictureError(
                f'grasp state: utilisation of {len(used)} members: must be {members}'
            )
    if len(message.slip_direction) != 3:
        raise PictureError(
            f'grasp state: slip_direction has {len(message.slip_direction)} numbers; must be 3'
        )


def check_status(message: Any) -> None:
    """Raise PictureError if a status code is unknown."""
    if message.code not in tuple(Status):
        raise PictureError(
            f'manipulation status: code {message.code}: must be one of ManipulationStatus'
        )


def read_line(marker: Any) -> Array:
    """Return the points (k, 3) of a marker [m]."""
    points = np.array([(p.x, p.y, p.z) for p in marker.points], dtype=float).reshape(-1, 3)
    what = f'markers: {marker.ns} {marker.id}'
    if not (np.abs(points) <= MAX_DISTANCE).all():
        raise PictureError(f'{what}: points must be finite, at most {MAX_DISTANCE:g} m away')
    if len(points) % GROUPS[marker.ns]:
        raise PictureError(
            f'{what}: {len(points)} points: must be a multiple of {GROUPS[marker.ns]}'
        )
    if marker.ns == DEFORMED and not np.linalg.norm(np.diff(points, axis=0), axis=1).any():
        raise PictureError(f'{what}: all points are equal; must be a line with a length')
    return points
