# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Barrier on the distances of robot and held object from obstacles.

Obstacle by obstacle, the values are the distances of the parts of the robot (members, modules and
rods) from the obstacle; or, of the barrier with the object, the object's distance from each.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, partial

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.distances import collision_model, nearest_on_segment
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.model.convex_object import segment_gaps, SegmentGaps
from isotruss_ros.core.model.object_samples import ObjectSamples
from isotruss_ros.core.model.obstacle import Obstacle
from isotruss_ros.core.model.separation import separate
from isotruss_ros.core.numerics.arrays import Array, as_xy, Indices, Points
from isotruss_ros.core.safety.barrier_law import (
    ActiveValues,
    BarrierLaw,
    NO_ACTIVE_VALUES,
    Selection,
)
from isotruss_ros.core.safety.barriers import NeighborList
import numpy as np


class ObstacleBarrier:
    """
    Barrier on the distances from obstacles [m].

    :param obstacles: obstacles at the poses at which the distances are evaluated.
    :param neighbors: neighbour list of an earlier barrier for the same parts.
    """

    status = Status.SLOWED_OBSTACLE

    def __init__(
        self,
        robot: Mechanism,
        law: BarrierLaw,
        obstacles: Sequence[Obstacle],
        needs_object: bool,
        neighbors: NeighborList | None = None,
    ) -> None:
        self.law, self.needs_object, self.obstacles = law, needs_object, tuple(obstacles)
        self._robot, self._model = robot, collision_model(robot)
        self._neighbors = neighbors or NeighborList(law)
        self._count = 1 if needs_object else len(self._model.part_radii)
        self._moves = any(any(obstacle.velocity) for obstacle in self.obstacles)

    def with_moving(self, moving: Sequence[Obstacle]) -> ObstacleBarrier:
        """Return the barrier with further obstacles, and the neighbour list of this barrier."""
        if not moving:
            return self
        obstacles = (*self.obstacles, *moving)
        return type(self)(self._robot, self.law, obstacles, self.needs_object, self._neighbors)

    @cached_property
    def _circles(self) -> tuple[Points, Array]:
        """Return centres (o,) and radii (o,) of circles that enclose the obstacles [m]."""
        bodies = [obstacle.body for obstacle in self.obstacles]
        radii = np.array([body.shape.reach for body in bodies])
        return np.array([body.center for body in bodies]), radii

    def _segment_gaps(self, numbers: Indices, starts: Points, ends: Points) -> SegmentGaps:
        """Return the gaps (k,) of k obstacles, each to a segment of its own."""
        bodies = ObjectSamples([self.obstacles[k].body for k in numbers.tolist()])
        gaps = segment_gaps(bodies, starts[:, None], ends[:, None])  # type: ignore[arg-type]
        return SegmentGaps(*(part[:, 0] for part in gaps))

    def active(self, config: Configuration, grip: Grip | None) -> ActiveValues:
        """Return the distances that are near the bound; see `Barrier.active`."""
        if not self.obstacles:
            return NO_ACTIVE_VALUES
        relevant_grip = grip if self.needs_object else None
        measure = partial(self.values, config, grip)
        close, distances = self._neighbors.find_close(
            config, relevant_grip, measure, self.obstacles
        )
        if not len(close):
            return NO_ACTIVE_VALUES
        numbers, parts = np.divmod(close, self._count)
        by_travel: Array | float = 0.0
        if self.needs_object:
            bodies = (self.obstacles[k].body for k in numbers.tolist())
            nearest = [separate(body, grip.body) for body in bodies]
            normals, points = np.array([(s.normal, s.point) for s in nearest]).T
            moments = (normals.conj() * 1j * (points - grip.body.center)).real
            by_twist = np.column_stack([as_xy(normals), moments])
            by_travel = by_twist @ grip_jacobian(config, grip)[:3]
            by_nodes = np.zeros((len(close), 2 * len(config.points)))
            gaps = distances
        else:
            starts, ends = self._model.part_ends(config, parts)
            gaps, normals, shares = self._segment_gaps(numbers, starts, ends)
            rows = self._model.part_rows(config, parts, shares, -normals)
            by_nodes, points = rows.view(np.float64), starts + shares * (ends - starts)
        if not self._moves:
            return ActiveValues(close, distances, by_nodes, by_travel)
        # Velocities of the obstacles' nearest points.
        surface = zip(numbers.tolist(), points - gaps * normals, strict=True)
        velocities = np.array([self.obstacles[k].velocity_at(point) for k, point in surface])
        drift = -(velocities * normals.conj()).real
        return ActiveValues(close, distances, by_nodes, by_travel, drift)

    def values(self, config: Configuration, grip: Grip | None, indices: Selection) -> Array:
        """
        Return the distances [m]; see `Barrier.values`.

        Beyond the band they may be the distances from enclosing circles.
        """
        if isinstance(indices, slice):
            indices = np.arange(len(self.obstacles) * self._count)[indices]
        centers, reaches = self._circles
        numbers, parts = np.divmod(indices, self._count)
        if self.needs_object:
            distances = np.abs(grip.body.center - centers[numbers]) - grip.body.shape.reach
            distances -= reaches[numbers]
            for i in np.flatnonzero(distances < self.law.active_below).tolist():
                distances[i] = separate(self.obstacles[numbers[i]].body, grip.body).distance
            return distances
        starts, ends = self._model.part_ends(config, parts)
        radii = self._model.part_radii[parts]
        distances = (
            nearest_on_segment(centers[numbers], starts, ends)[0] - radii - reaches[numbers]
        )
        near = np.flatnonzero(distances < self.law.active_below)
        if len(near):
            gaps = self._segment_gaps(numbers[near], starts[near], ends[near]).gaps
            distances[near] = gaps - radii[near]
        return distances

    def names(self, indices: Indices) -> list[str]:
        """Return the names of a part, or the object, and the obstacle; see `Barrier.names`."""
        parts = ['the object'] if self.needs_object else self._model.part_names()
        pairs = [divmod(int(index), self._count) for index in indices]
        return [f'{parts[part]} and obstacle {self.obstacles[k].name}' for k, part in pairs]
