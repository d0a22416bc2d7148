# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random obstacles around a robot that holds an object, and the clearance from them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from isotruss_ros.core import (
    Configuration,
    ConvexObject,
    Disc,
    Ellipse,
    Obstacle,
    Polygon,
    RollingGrip,
)
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.kinematics.distances import collision_model
from isotruss_ros.core.model.convex_object import segment_gaps
from isotruss_ros.core.model.obstacle import HalfPlane
from isotruss_ros.core.model.separation import separate
from isotruss_ros.core.model.shapes import Shape
import numpy as np


class Placed(NamedTuple):
    """Free object beside a robot in a configuration."""

    config: Configuration  #: configuration of the robot
    body: ConvexObject  #: the object at its pose


def clearance(held: RollingGrip | HeldGrip | Placed, obstacles: Sequence[Obstacle]) -> float:
    """Return the least distance of robot and object from obstacles [m]."""
    model, config = collision_model(held.config.robot), held.config
    body = held.grip.body if isinstance(held, RollingGrip) else held.body
    starts, ends = model.part_ends(config)
    distances = [np.inf]
    for obstacle in obstacles:
        gaps = segment_gaps(obstacle.body, starts, ends).gaps
        distances += [(gaps - model.part_radii).min()]
        distances += [separate(obstacle.body, body).distance]
    return float(min(distances))


def random_obstacle_shape(rng: np.random.Generator) -> Shape:
    """Return a disc, a box or an ellipse of 0.1 to 0.4 m."""
    a, b = rng.uniform(0.05, 0.2, 2)
    kind = rng.integers(3)
    if kind == 0:
        return Disc(2.0 * a)
    return Ellipse((a, b)) if kind == 1 else Polygon(((-a, -b), (a, -b), (a, b), (-a, b)))


def random_room(
    rng: np.random.Generator,
    held: RollingGrip | HeldGrip | Placed,
    count: int = 3,
    least: float = 0.025,
    wall: bool = False,
) -> list[Obstacle]:
    """Return obstacles that are near the robot, but not nearer than `least` [m]."""
    points, obstacles = held.config.points, []
    middle, reach = points.mean(), np.abs(points - points.mean()).max()
    for number in range(count):
        while True:
            place = middle + reach * complex(*rng.uniform(-1.3, 1.3, 2))
            pose = (place.real, place.imag, rng.uniform(-3.0, 3.0))
            is_wall = wall and number == 0
            shape = HalfPlane() if is_wall else random_obstacle_shape(rng)
            obstacle = Obstacle(f'o{number}', ConvexObject(shape, pose))
            if clearance(held, [obstacle]) > least:
                break
        obstacles.append(obstacle)
    return obstacles
