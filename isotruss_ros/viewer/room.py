# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Obstacles and planned path that a view displays, updated from messages."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Any

from isotruss_ros.core import Obstacle, Pose
from isotruss_ros.core.inputs import StampedInput
from isotruss_ros.core.model.obstacle import MAX_OBSTACLES
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.recording.encoded_values import RecordedCycleError
from isotruss_ros.core.recording.recorded_cycle import read_cycle
from isotruss_ros.core.servo.servo_settings import OBSTACLE_TIMEOUT
from isotruss_ros.viewer.message_checks import MAX_DISTANCE, PictureError
import numpy as np

#: Smallest time between two records of cycles that are read [s]; to read one takes about 0.3 ms.
CYCLE_PERIOD = 0.1
#: Distance from the end of the planned path at which the path is not shown any more [m].
ARRIVAL_DISTANCE = 0.01


class Room:
    """
    Obstacles and planned path in the robot frame.

    Times `now` are on the clock of the messages' arrival [s].

    :ivar resting: obstacles at rest.
    :ivar path: points (k, 2) of the planned path [m]; None without one.
    """

    def __init__(self) -> None:
        self.resting: tuple[Obstacle, ...] = ()
        self.path: Array | None = None
        #: Moving obstacles by name, each with its time of arrival.
        self._moving: dict[str, tuple[Obstacle, float]] = {}
        self._last_cycle = -math.inf

    def take_obstacles(self, obstacles: Sequence[Obstacle], now: float) -> None:
        """Update moving obstacles; others remain where they were last."""
        moving = self._moving | {obstacle.name: (obstacle, now) for obstacle in obstacles}
        if len(moving) > MAX_OBSTACLES:
            raise PictureError(
                f'obstacles: {len(moving)} moving obstacles; must be at most {MAX_OBSTACLES}'
            )
        self._moving = moving

    def clear_moving(self) -> None:
        """Discard all moving obstacles until the next message."""
        self._moving = {}

    def list_obstacles(self, now: float) -> list[tuple[Obstacle, bool]]:
        """Return all obstacles, each with whether it is at rest or was in a recent message."""
        moving = [(o, now - arrival < OBSTACLE_TIMEOUT) for o, arrival in self._moving.values()]
        return [*((obstacle, True) for obstacle in self.resting), *moving]

    def receive_cycle(self, message: Any, now: float) -> None:
        """Replace the obstacles by those of a recorded cycle of the node `manipulation`."""
        if abs(now - self._last_cycle) < CYCLE_PERIOD:
            return
        self._last_cycle = now
        try:
            record = read_cycle(message.data)
        except RecordedCycleError as error:
            raise PictureError(str(error)) from error
        received, resting = record.inputs.get('obstacles'), record.settings.obstacles
        moving = received.value if isinstance(received, StampedInput) else ()
        if not (_are_obstacles(resting) and _are_obstacles(moving)):
            raise PictureError('record of a cycle: obstacles: must be obstacles of the core')
        self.resting = resting
        self.clear_moving()
        for obstacle in moving:
            age = 0.0 if obstacle.stamp is None else record.now - obstacle.stamp
            self.take_obstacles([obstacle], now - age)

    def receive_path(self, message: Any, now: float) -> None:
        """
        Show a path until the object is at its end.

        :param message: nav_msgs/Path in the robot frame.
        """
        places = [stamped.pose.position for stamped in message.poses]
        points = np.array([(place.x, place.y) for place in places], dtype=float).reshape(-1, 2)
        if not (np.abs(points) <= MAX_DISTANCE).all():  # excludes NaN
            raise PictureError(
                f'planned path: points must be finite, at most {MAX_DISTANCE:g} m away'
            )
        self.path = points if len(points) > 1 else None

    def leave_path(self, pose: Pose) -> None:
        """
        Discard the planned path if the object is at its end.

        :param pose: pose of the object.
        """
        if self.path is not None and math.dist(self.path[-1], pose[:2]) < ARRIVAL_DISTANCE:
            self.path = None


def _are_obstacles(values: object) -> bool:
    """Return whether a value is a tuple of obstacles."""
    return isinstance(values, tuple) and all(isinstance(value, Obstacle) for value in values)
