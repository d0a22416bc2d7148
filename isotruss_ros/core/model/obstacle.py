# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Obstacles: convex objects and walls in the plane of the robot, at rest or in motion."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
import math

from isotruss_ros.core.errors import GraspError, quote
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.polygon import Polygon
from isotruss_ros.core.numerics.argument_kinds import check_kind
from isotruss_ros.core.numerics.arrays import finite_array, Points
from isotruss_ros.core.numerics.records import Record
import numpy as np

#: Largest number of obstacles at rest, and of moving ones [-]; a cycle with more takes too long.
MAX_OBSTACLES = 200
#: Longest name of an obstacle [characters].
MAX_NAME_LENGTH = 80
#: Largest speed [m/s] and turn rate [rad/s] of an obstacle. A hand reaches 2 m/s; a third of this
#: limit would refuse it, three times this limit would accept a slow speed in cm/s.
MAX_SPEED, MAX_TURN_RATE = 5.0, 20.0
#: Default of the smallest distance of robot and object from obstacles [m].
OBSTACLE_CLEARANCE = 0.02
#: Half of the length of a wall [m], ten times the largest coordinate of a pose.
HALF_LENGTH = 1e3


@dataclass(frozen=True)
class HalfPlane(Polygon):
    """
    Half plane x <= 0 of the object's frame, the shape of walls.

    The origin of the frame is on the wall, and its x axis points away from the wall into free
    space.
    """

    vertices: tuple[tuple[float, float], ...] = field(
        init=False,
        repr=False,
        default=(
            (0.0, -HALF_LENGTH),
            (0.0, HALF_LENGTH),
            (-HALF_LENGTH, HALF_LENGTH),
            (-HALF_LENGTH, -HALF_LENGTH),
        ),
    )
    corner_radius: float = field(init=False, repr=False, default=0.0)

    def __post_init__(self) -> None:
        """Accept vertices beyond the largest size of objects."""


@dataclass(frozen=True, repr=False)
class Obstacle(Record, headline=('name', 'body', 'velocity', 'stamp')):
    """
    Obstacle that robot and held object must not touch.

    :ivar name: name of the obstacle.
    :ivar body: shape and pose of the obstacle, in the robot frame.
    :ivar velocity: velocity (vx, vy, omega) of the body's frame in the robot frame [m/s, rad/s].
    :ivar stamp: time of pose and velocity [s]; None: the obstacle is always at rest.
    :raises GraspError: the name is empty or too long, or a number is not within its range.
    """

    name: str
    body: ConvexObject
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    stamp: float | None = None

    def __post_init__(self) -> None:
        """Check the fields."""
        if not isinstance(self.name, str) or not 0 < len(self.name) <= MAX_NAME_LENGTH:
            limits = f'1 to {MAX_NAME_LENGTH} characters'
            raise GraspError(f'name of an obstacle {self.name!r:.90}: must be a text of {limits}')
        check_kind('body', self.body, 'ConvexObject')
        what = f'obstacle {quote(self.name)}: velocity (vx, vy [m/s], omega [rad/s])'
        velocity = finite_array(self.velocity, 3, what, GraspError).tolist()
        if math.hypot(*velocity[:2]) > MAX_SPEED or abs(velocity[2]) > MAX_TURN_RATE:
            limits = f'{MAX_SPEED:g} m/s and {MAX_TURN_RATE:g} rad/s'
            raise GraspError(f'{what} {velocity}: must be at most {limits}')
        object.__setattr__(self, 'velocity', tuple(velocity))

    def at(self, time: float) -> Obstacle:
        """
        Return the obstacle at the pose to which its velocity has moved it.

        :param time: time on the clock of the stamp [s].
        """
        if self.stamp is None:
            return self
        pose = np.array(self.body.pose) + (time - self.stamp) * np.array(self.velocity)
        return replace(self, body=self.body.moved_to(pose), stamp=time)

    def velocity_at(self, points: complex | Points) -> Points:
        """
        Return the velocities (k,) of material points of the obstacle, vx + i vy [m/s].

        :param points: (k,) points x + iy in the robot frame [m].
        """
        vx, vy, omega = self.velocity
        return complex(vx, vy) + 1j * omega * (points - self.body.center)
