# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The barriers of a shape: rigidity, and distances between parts of the robot and to its object.

Verlet's neighbour list says which of the distances need measuring.
"""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import NamedTuple

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.distances import collision_model
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.kinematics.rigidity import Modes, rigidity_index
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.safety.barrier_law import (
    ActiveValues,
    BarrierLaw,
    EVERYTHING,
    NOTHING,
    Selection,
)
from isotruss_ros.core.safety.margins import grip_gradients, object_distances
import numpy as np

#: Pairs that are this much farther apart than close are in the list too [m].
SKIN = 0.05
NO_PAIRS = np.zeros(0, dtype=np.intp)


class Measured(NamedTuple):
    """A state in which distances were measured."""

    config: Configuration  #: where the robot was
    grip: Grip | None  #: what it held; None where no distance depends on that
    spare: float  #: how far the smallest of the distances was from being close [m]

    def holds(self, config: Configuration, grip: Grip | None) -> bool:
        """
        Return whether none of the distances can be close in another state.

        :param config: where the robot is.
        :param grip: what it holds, None as in the measured state.
        """
        if self.spare <= 0.0:
            return False
        then = self.grip
        moved = float(np.abs(config.points - self.config.points).max())
        if grip is None or then is None:
            return grip is then and 2.0 * moved < self.spare
        return moved + max(moved, _moved(grip, then)) < self.spare


def _moved(grip: Grip, then: Grip) -> float:
    """Return how far no point of the object has moved [m]; infinite where it is another."""
    if grip.members != then.members:
        return math.inf
    body, before = grip.body, then.body
    if body.shape is not before.shape and body.shape != before.shape:
        return math.inf
    return abs(body.center - before.center) + abs(body.turn - before.turn) * body.shape.reach


class NeighborList:
    """
    Pairs of parts that may be close, measured only when they may have become so.

    It saves work and changes no result: the distance of two parts changes by no more than what
    both of them have moved. The pairs near each other are in a list; all others are measured
    again when they may have entered it, those of the list when one of them may be close.

    :param near: pairs closer than this are close [m].
    """

    def __init__(self, near: float) -> None:
        self._near = near
        self._pairs = NO_PAIRS
        self._others: Measured | None = None
        self._listed: Measured | None = None

    def find_close(
        self,
        config: Configuration,
        grip: Grip | None,
        measure: Callable[[Selection], Array],
    ) -> tuple[Indices, Array]:
        """
        Return the numbers of the pairs that are close, and their distances [m].

        :param config: where the robot is.
        :param grip: what it holds; None where no distance depends on that.
        :param measure: distances [m] of pairs of these numbers, in this state.
        """
        if self._others is None or not self._others.holds(config, grip):
            distances = measure(EVERYTHING)
            self._pairs = np.flatnonzero(distances < self._near + SKIN)
            spare = SKIN if len(self._pairs) else distances.min(initial=np.inf) - self._near
            self._others = Measured(config, grip, float(spare))
            distances = distances[self._pairs]
        elif not len(self._pairs) or (self._listed and self._listed.holds(config, grip)):
            return NO_PAIRS, np.zeros(0)
        else:
            distances = measure(self._pairs)
        smallest = float(distances.min(initial=np.inf))
        self._listed = Measured(config, grip, smallest - self._near)
        close = distances < self._near
        return self._pairs[close], distances[close]


class SelfCollisionBarrier:
    """
    Parts of the robot stay apart, see `CollisionModel`.

    :param robot: the robot.
    :param law: of the distance between surfaces [m].
    """

    status = Status.SLOWED_SELF_COLLISION
    needs_object = False

    def __init__(self, robot: Mechanism, law: BarrierLaw) -> None:
        self.law = law
        self._model = collision_model(robot)
        self._neighbors = NeighborList(law.active_below)

    def active(self, config: Configuration, grip: Grip | None) -> ActiveValues:
        """Return the pairs that are close; see `Barrier.active`."""
        pairs, distances = self._neighbors.find_close(
            config, None, lambda indices: self.values(config, grip, indices)
        )
        if not len(pairs):
            return NOTHING
        return ActiveValues(pairs, distances, self._model.gradients(config, pairs))

    def values(self, config: Configuration, grip: Grip | None, indices: Selection) -> Array:
        """Return the distances of pairs [m]; see `Barrier.values`."""
        return self._model.distances(config, indices)

    def names(self, indices: Indices) -> list[str]:
        """Return the names of pairs; see `Barrier.names`."""
        return self._model.names(indices)


class ObjectBarrier:
    """
    The robot stays clear of the object that it holds, beside the grip; see `CollisionModel`.

    :param robot: the robot.
    :param law: of the distance between surfaces [m].
    """

    status = Status.SLOWED_OBJECT
    needs_object = True

    def __init__(self, robot: Mechanism, law: BarrierLaw) -> None:
        self.law = law
        self._model = collision_model(robot)
        self._neighbors = NeighborList(law.active_below)

    def active(self, config: Configuration, grip: Grip) -> ActiveValues:
        """Return the parts that are close to the object; see `Barrier.active`."""
        parts, distances = self._neighbors.find_close(
            config, grip, lambda indices: self.values(config, grip, indices)
        )
        if not len(parts):
            return NOTHING
        return ActiveValues(parts, distances, *grip_gradients(config, grip, parts))

    def values(self, config: Configuration, grip: Grip, indices: Selection) -> Array:
        """Return the distances of parts, inf for those at the grip [m]; see `Barrier.values`."""
        far = self.law.active_below + SKIN
        return object_distances(config, grip.body, grip.members, far, indices)

    def names(self, indices: Indices) -> list[str]:
        """Return the names of parts; see `Barrier.names`."""
        names = self._model.part_names()
        return [f'{names[i]} and the object' for i in indices]


class RigidityBarrier:
    """
    The shape stays rigid, see `rigidity_index`.

    All singular values that are near the bound count: where two are close, the one that is
    the smallest after a step may be another than before it.

    :param robot: the robot.
    :param law: of the rigidity index, which is 1 at home [-].
    """

    status = Status.SLOWED_RIGIDITY
    needs_object = False

    def __init__(self, robot: Mechanism, law: BarrierLaw) -> None:
        self.law = law
        self._index = rigidity_index(robot)
        self._far: tuple[Configuration, float] | None = None

    def active(self, config: Configuration, grip: Grip | None) -> ActiveValues:
        """Return the least rigid modes; see `Barrier.active`."""
        if self._far is not None and self.change(config, self._far[0]) < self._far[1]:
            return NOTHING
        modes = self._index.modes(config)
        spare = float(modes.values[0]) - self.law.active_below
        self._far = (config, spare) if spare > 0.0 else None
        if spare >= 0.0:
            return NOTHING
        count = int((modes.values < self.law.active_below).sum())
        few = Modes(modes.values[:count], modes.rows[:, :count], modes.nodes[:, :count])
        return ActiveValues(np.arange(count), few.values, self._index.gradients(config, few))

    def change(self, config: Configuration, other: Configuration) -> float:
        """
        Return by how much the rigidity indices of two shapes can differ at most.

        :param config: one shape.
        :param other: the other shape.
        """
        change = np.abs(config.gradients - other.gradients) * self._index.weights
        return math.sqrt(change @ change)

    def values(self, config: Configuration, grip: Grip | None, indices: Selection) -> Array:
        """Return the rigidity index of modes, least first; see `Barrier.values`."""
        return self._index.modes(config).values[indices]

    def names(self, indices: Indices) -> list[str]:
        """Return one name for all; see `Barrier.names`."""
        return ['the rigidity of the shape'] * len(indices)
