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
from isotruss_ros.core.kinematics.distances import collision_model
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.model.convex_object import SegmentGaps
from isotruss_ros.core.model.object_samples import ObjectSamples
from isotruss_ros.core.model.obstacle import Obstacle
from isotruss_ros.core.model.separation import separate
from isotruss_ros.core.numerics.arrays import Array, as_xy, Flags, Indices
from isotruss_ros.core.safety.barrier_law import (
    ActiveValues,
    BarrierLaw,
    NO_ACTIVE_VALUES,
    Selection,
)
from isotruss_ros.core.safety.barriers import bent_parts, NeighborList
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
    def _bodies(self) -> ObjectSamples:
        """Return the objects at the poses of the obstacles."""
        return ObjectSamples([obstacle.body for obstacle in self.obstacles])

    @cached_property
    def _reaches(self) -> Array:
        """Return the radii (o,) of circles that enclose the obstacles [m]."""
        return np.array([obstacle.body.shape.reach for obstacle in self.obstacles])

    @cached_property
    def _is_round(self) -> Flags:
        """Return which obstacles (o,) fill these circles."""
        return np.array([obstacle.body.shape.is_round for obstacle in self.obstacles])

    def active(self, config: Configuration, grip: Grip | None) -> ActiveValues:
        """Return the distances that are near the bound; see `Barrier.active`."""
        if not self.obstacles:
            return NO_ACTIVE_VALUES
        relevant_grip, bent = grip if self.needs_object else None, bent_parts(grip)
        measure = partial(self._measure, config, grip)
        close, nearest = self._neighbors.find_close(
            config, relevant_grip, measure, self.obstacles, None if self.needs_object else bent
        )
        if not len(close):
            return NO_ACTIVE_VALUES
        numbers, parts = np.divmod(close, self._count)
        gaps, normals, shares = nearest
        by_travel: Array | float = 0.0
        if self.needs_object:
            bodies = (self.obstacles[k].body for k in numbers.tolist())
            points = np.array([separate(body, grip.body).point for body in bodies])
            moments = (normals.conj() * 1j * (points - grip.body.center)).real
            by_twist = np.column_stack([as_xy(normals), moments])
            by_travel = by_twist @ grip_jacobian(config, grip)[:3]
            by_nodes = np.zeros((len(close), 2 * len(config.points)))
        else:
            by_nodes = self._model.part_rows(config, parts, shares, -normals).view(np.float64)
            points = self._model.points_on(config, parts, shares, bent)
            gaps = gaps + self._model.part_radii[parts]  # from the centre lines of the parts
        if not self._moves:
            return ActiveValues(close, nearest.gaps, by_nodes, by_travel)
        # Velocities of the obstacles' nearest points.
        surface = zip(numbers.tolist(), points - gaps * normals, strict=True)
        velocities = np.array([self.obstacles[k].velocity_at(point) for k, point in surface])
        drift = -(velocities * normals.conj()).real
        return ActiveValues(close, nearest.gaps, by_nodes, by_travel, drift)

    def values(self, config: Configuration, grip: Grip | None, indices: Selection) -> Array:
        """
        Return the distances [m]; see `Barrier.values`.

        Beyond the band they may be the distances from enclosing circles.
        """
        return self._measure(config, grip, indices).gaps

    def _measure(
        self, config: Configuration, grip: Grip | None, indices: Selection
    ) -> SegmentGaps:
        """Return `values` with their directions, which are exact within the band."""
        if isinstance(indices, slice):
            indices = np.arange(len(self.obstacles) * self._count)[indices]
        numbers, parts = np.divmod(indices, self._count)
        centers, reaches = self._bodies.center[numbers], self._reaches[numbers]
        if self.needs_object:
            away = grip.body.center - centers
            distances = np.abs(away) - grip.body.shape.reach - reaches
            normals = np.ones(len(away), dtype=np.complex128)
            for i in np.flatnonzero(distances < self.law.active_below).tolist():
                body = self.obstacles[numbers[i]].body
                distances[i], normals[i], _ = separate(body, grip.body)
            return SegmentGaps(distances, normals, np.zeros(len(away)))
        lines = self._model.lines(config, parts, bent_parts(grip))
        radii = self._model.part_radii[parts]
        gaps, toward, shares = lines.nearest_to(centers)
        distances = gaps - radii - reaches
        nearest = SegmentGaps(distances, -toward, shares)
        near = np.flatnonzero((distances < self.law.active_below) & ~self._is_round[numbers])
        if len(near):
            bodies = self._bodies.take_samples(numbers[near])
            gaps, nearest.normals[near], nearest.shares[near] = lines.take(near).gaps_to_each(
                bodies
            )
            distances[near] = gaps - radii[near]
        return nearest

    def names(self, indices: Indices) -> list[str]:
        """Return the names of a part, or the object, and the obstacle; see `Barrier.names`."""
        parts = ['the object'] if self.needs_object else self._model.part_names()
        pairs = [divmod(int(index), self._count) for index in indices]
        return [f'{parts[part]} and obstacle {self.obstacles[k].name}' for k, part in pairs]
