# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random grasps of random objects, each of which follows from a seed and its number."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from isotruss_ros import core
from isotruss_ros.core.errors import ConfigurationError, GraspError, IsotrussError
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.pose import check_range, MAX_FRICTION, MAX_SIZE, MIN_DIAMETER
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.arrays import Array, finite_array, MAX_LOAD
import numpy as np

#: Kinds of random shapes.
KINDS = ('disc', 'polygon', 'ellipse')
#: Smallest and largest number of corners of a random polygon [-].
CORNER_COUNTS = 3, 8
#: Smallest ratio of the axes of the ellipse, or of that on which the corners of a polygon are [-].
MIN_ASPECT_RATIO = 0.5
#: Smallest gap between corners of a polygon, relative to the largest one less this gap [-].
MIN_CORNER_GAP = 0.3
#: Largest number of draws of one grasp [-]; with the presets, one of four draws has a place.
MAX_DRAWS = 1000


class DatasetError(IsotrussError, ValueError):
    """A setting or a file of a data set is invalid."""


@dataclass(frozen=True)
class GraspDistribution:
    """
    Distribution of random grasps; each quantity is uniform within its range.

    :ivar objects: kinds of `KINDS`, of which random shapes are drawn, and objects, whose shapes
        are used; all have the same probability.
    :ivar sizes: smallest and largest diameter of a random disc, and long axis of an ellipse, or
        of the ellipse on which the corners of a polygon are [m].
    :ivar friction: smallest and largest coefficient of friction, of objects without their own [-].
    :ivar depth: smallest and largest penetration of the straight members before the object is
        free [m].
    :ivar travel: largest travel of a roller since home [m].
    :ivar force: largest magnitude of the external force along x and along y [N].
    :ivar moment: largest magnitude of the external moment [N m].
    :raises DatasetError: a number or the name of a kind is invalid.
    """

    objects: tuple[str | ConvexObject, ...] = KINDS
    sizes: tuple[float, float] = (0.1, 0.35)
    friction: tuple[float, float] = (0.3, 1.2)
    depth: tuple[float, float] = (0.0, 0.03)
    travel: float = 0.1
    force: float = 0.0
    moment: float = 0.0

    def __post_init__(self) -> None:
        """Check the fields."""
        if not self.objects:
            raise DatasetError('objects: none; must be one or more')
        for kind in self.objects:
            if kind not in KINDS and not isinstance(kind, ConvexObject):
                names = ', '.join(KINDS)
                raise DatasetError(f'objects: {kind!r}: must be one of {names}, or an object')
        _check_bounds(self.sizes, 'sizes', 'm', MIN_DIAMETER, MAX_SIZE)
        _check_bounds(self.friction, 'friction', '', 0.0, MAX_FRICTION)
        _check_bounds(self.depth, 'depth', 'm', -MAX_SIZE, MAX_SIZE)
        check_range(self.travel, 'travel', 'm', 0.0, MAX_SIZE, DatasetError)
        check_range(self.force, 'force', 'N', 0.0, MAX_LOAD, DatasetError)
        check_range(self.moment, 'moment', 'N m', 0.0, MAX_LOAD, DatasetError)


class RandomGrasp(NamedTuple):
    """Arguments of `settle_grasp` for one random grasp."""

    config: core.Configuration  #: configuration of the robot
    body: ConvexObject  #: the object at its given pose
    friction: float  #: coefficient of friction [-]
    external_wrench: Array  #: (3,) external wrench (fx, fy, m) [N, N m]
    item: int  #: index of the kind or object in `GraspDistribution.objects`


def draw_grasp(
    robot: core.Robot, distribution: GraspDistribution, seed: int, number: int
) -> RandomGrasp:
    """
    Return a random grasp, which depends only on the arguments.

    Two members that admit a place are drawn. The object is between them, at a random angle.

    :param robot: the robot, in a random configuration.
    :param distribution: distribution of the grasps.
    :param seed: random seed of the data set, not negative.
    :param number: number of the grasp in the data set, not negative.
    :raises DatasetError: no grasp was found in `MAX_DRAWS` draws.
    """
    rng = np.random.default_rng([seed, number])
    names, count = robot.member_names, len(robot.home.roller_positions)
    config = None
    for _ in range(MAX_DRAWS):
        try:
            if config is None:
                travel = distribution.travel
                config = robot.configuration(rng.uniform(-travel, travel, count))
            item = int(rng.integers(len(distribution.objects)))
            shape, own_friction = _draw_object(rng, distribution, item)
            members = [names[i] for i in rng.choice(len(names), 2, replace=False)]
            angle, depth = rng.uniform(-np.pi, np.pi), rng.uniform(*distribution.depth)
            body = core.place_between(config, members, shape, angle, depth).body
        except (ConfigurationError, GraspError):
            continue
        friction = rng.uniform(*distribution.friction)
        if own_friction is not None:
            friction = own_friction
        largest = np.array([distribution.force, distribution.force, distribution.moment])
        return RandomGrasp(config, body, friction, rng.uniform(-largest, largest), item)
    low, high = distribution.sizes
    raise DatasetError(
        f'grasp {number}: no place between two members of {robot.name} in {MAX_DRAWS} draws: '
        f'sizes {low:g} to {high:g} m and travel {distribution.travel:g} m: must be smaller'
    )


def _draw_object(
    rng: np.random.Generator, distribution: GraspDistribution, item: int
) -> tuple[Shape, float | None]:
    """Return the shape of an item of a distribution, and its own coefficient of friction."""
    given = distribution.objects[item]
    if isinstance(given, ConvexObject):
        return given.shape, given.friction
    return draw_shape(rng, given, distribution.sizes), None


def draw_shape(rng: np.random.Generator, kind: str, sizes: tuple[float, float]) -> Shape:
    """Return a random shape of a kind, with a size in a range [m], see `GraspDistribution`."""
    size, ratio = rng.uniform(*sizes), rng.uniform(MIN_ASPECT_RATIO, 1.0)
    if kind == 'disc':
        return core.Disc(size)
    a, b = 0.5 * size, 0.5 * size * ratio
    if kind == 'ellipse':
        return core.Ellipse((a, b))
    low, high = CORNER_COUNTS
    gaps = MIN_CORNER_GAP + rng.random(int(rng.integers(low, high + 1)))
    angles = 2.0 * np.pi * np.cumsum(gaps) / gaps.sum()
    return core.Polygon(np.column_stack([a * np.cos(angles), b * np.sin(angles)]).tolist())


def _check_bounds(
    bounds: tuple[float, float], what: str, unit: str, low: float, high: float
) -> None:
    """Raise DatasetError unless two numbers are in order, and within a range."""
    first, last = finite_array(bounds, 2, f'{what} [{unit}]', DatasetError).tolist()
    for value in (first, last):
        check_range(value, what, unit, low, high, DatasetError)
    if first > last:
        raise DatasetError(f'{what} {first:g} {last:g}: must be the smallest, then the largest')
