# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Barriers of rigidity, of clearances between parts of the robot, and of clearances to the object.

Distances are evaluated for those pairs of parts that a Verlet neighbour list selects.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
import math
from typing import NamedTuple

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.distances import (
    BentParts,
    collision_model,
    find_bend_change,
)
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.kinematics.rigidity import Modes, rigidity_index
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.model.convex_object import ConvexObject, SegmentGaps
from isotruss_ros.core.model.obstacle import Obstacle
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices
from isotruss_ros.core.safety.barrier_law import (
    ActiveValues,
    ALL_VALUES,
    BarrierLaw,
    NO_ACTIVE_VALUES,
    Selection,
)
from isotruss_ros.core.safety.margins import object_gaps
import numpy as np

#: No distances.
NO_GAPS = SegmentGaps(np.zeros(0), np.zeros(0, dtype=np.complex128), np.zeros(0))


class EvaluatedState(NamedTuple):
    """State of robot and grip in which the distances of pairs of parts were last evaluated."""

    config: Configuration  #: configuration of the robot
    grip: Grip | None  #: grip; None if the distances do not depend on it
    spare: float  #: lower bound of the distances, minus `BarrierLaw.active_below` [m]
    obstacles: tuple[Obstacle, ...] = ()  #: obstacles
    bent: BentParts | None = None  #: displacements of the robot's parts

    def holds(
        self,
        config: Configuration,
        grip: Grip | None,
        obstacles: tuple[Obstacle, ...],
        bent: BentParts | None,
    ) -> bool:
        """Return whether all distances have fallen by less than `spare` since the evaluation."""
        moved = float(np.abs(config.points - self.config.points).max())
        moved += find_bend_change(self.bent, bent)
        if grip is not self.grip:
            if grip.members != self.grip.members:
                return False
            moved += max(moved, _bound_displacement(grip.body, self.grip.body))
        else:
            moved += moved
        if obstacles is not self.obstacles:
            if len(obstacles) != len(self.obstacles):
                return False
            pairs = zip(obstacles, self.obstacles, strict=True)
            moved += max(_bound_displacement(end.body, start.body) for end, start in pairs)
        return moved < self.spare


def _bound_displacement(end: ConvexObject, start: ConvexObject) -> float:
    """Return an upper bound of an object's displacement [m]; infinite for another shape."""
    if end is start:
        return 0.0
    if end.shape != start.shape:
        return math.inf
    return abs(end.center - start.center) + abs(end.turn - start.turn) * end.shape.reach


class NeighborList:
    """
    Verlet neighbour list of pairs of parts, which reduces the number of evaluated distances.

    A pair is close if the law limits the rate of its distance; the list contains all pairs up to
    `listed_below` [m], half of the law's band farther. All pairs are evaluated only if one outside
    of the list may have come that near, and the pairs of the list only if one of them may have
    become close. The results are exact.
    """

    def __init__(self, law: BarrierLaw) -> None:
        self._close_below, self._skin = law.active_below, 0.5 * law.band
        self.listed_below = self._close_below + self._skin
        self._list: Indices = np.zeros(0, dtype=np.intp)
        # States in which the distances of all pairs, and those of the list, were last evaluated.
        self._all_state: EvaluatedState | None = None
        self._list_state: EvaluatedState | None = None

    def find_close(
        self,
        config: Configuration,
        grip: Grip | None,
        measure: Callable[[Selection], SegmentGaps],
        obstacles: tuple[Obstacle, ...] = (),
        bent: BentParts | None = None,
    ) -> tuple[Indices, SegmentGaps]:
        """Return indices and distances of close pairs; `measure` evaluates distances."""
        # Verlet list: all pairs are measured after a motion by the skin, the listed ones after a
        # motion by which one of them could become close.
        state = config, grip, obstacles, bent
        if self._all_state is None or not self._all_state.holds(*state):
            measured = measure(ALL_VALUES)
            self._list = np.flatnonzero(measured.gaps < self.listed_below)
            listed = _choose(measured, self._list)
            # Pairs outside of the list are farther by at least the skin.
            smallest = measured.gaps.min(initial=np.inf)
            spare = self._skin if len(self._list) else smallest - self._close_below
            self._all_state = EvaluatedState(config, grip, float(spare), obstacles, bent)
        elif self._list_state.holds(*state):
            return self._list[:0], NO_GAPS
        else:
            listed = measure(self._list)
        spare = float(listed.gaps.min(initial=np.inf)) - self._close_below
        self._list_state = EvaluatedState(config, grip, spare, obstacles, bent)
        is_close = listed.gaps < self._close_below
        return self._list[is_close], _choose(listed, is_close)


def bent_parts(grip: Grip | None) -> BentParts | None:
    """Return the displacements of the robot's parts, if the grip has them."""
    return None if grip is None else grip.bent


def _choose(gaps: SegmentGaps, chosen: Indices | Flags) -> SegmentGaps:
    """Return chosen distances."""
    return SegmentGaps(*(part[chosen] for part in gaps))


class ClearanceBarrier:
    """
    Barrier on distances between surfaces [m].

    They are distances between parts of the robot, see `CollisionModel`; with `needs_object`, those
    of the held object from the parts outside of the grip. Parts are bent if the grip has their
    displacements, see `Grip.bent`.
    """

    def __init__(self, robot: Mechanism, law: BarrierLaw, needs_object: bool) -> None:
        self.law, self.needs_object = law, needs_object
        self.status = Status.SLOWED_OBJECT if needs_object else Status.SLOWED_SELF_COLLISION
        self._model, self._neighbors = collision_model(robot), NeighborList(law)

    def active(self, config: Configuration, grip: Grip | None) -> ActiveValues:
        """Return the distances that are near the bound; see `Barrier.active`."""
        relevant_grip, bent = grip if self.needs_object else None, bent_parts(grip)
        measure = partial(self._measure, config, grip)
        close, nearest = self._neighbors.find_close(config, relevant_grip, measure, bent=bent)
        if not len(close):
            return NO_ACTIVE_VALUES
        if relevant_grip is None:
            by_nodes = self._model.gradients(config, close, nearest)
            return ActiveValues(close, nearest.gaps, by_nodes)
        # By the nodes for a fixed object, and by roller travel for an object that rolls.
        body = relevant_grip.body
        by_nodes, by_twist = self._model.body_gradients(config, body, close, nearest, bent)
        by_travel = by_twist @ grip_jacobian(config, relevant_grip)[:3]
        return ActiveValues(close, nearest.gaps, by_nodes, by_travel)

    def values(self, config: Configuration, grip: Grip | None, indices: Selection) -> Array:
        """Return the distances [m], infinite for grasping members; see `Barrier.values`."""
        return self._measure(config, grip, indices).gaps

    def _measure(
        self, config: Configuration, grip: Grip | None, indices: Selection
    ) -> SegmentGaps:
        """Return the distances with their directions."""
        if not self.needs_object:
            return self._model.nearest(config, indices, bent_parts(grip))
        far = self._neighbors.listed_below
        return object_gaps(config, grip.body, grip.members, far, indices, grip.bent)

    def names(self, indices: Indices) -> list[str]:
        """Return the names of the pairs of parts, or of a part and the object."""
        if not self.needs_object:
            return self._model.names(indices)
        names = self._model.part_names()
        return [f'{names[i]} and the object' for i in indices]


class RigidityBarrier:
    """
    Barrier on the rigidity index of the configuration, see `rigidity_index`.

    Each small singular value is one value, because their order may change in a step.
    """

    status = Status.SLOWED_RIGIDITY
    needs_object = False

    def __init__(self, robot: Mechanism, law: BarrierLaw) -> None:
        self.law = law
        self._index = rigidity_index(robot)
        # Gradients of the constraints where the index was last evaluated, and its margin there.
        self._gradients, self._spare = np.array(np.nan), 0.0

    def active(self, config: Configuration, grip: Grip | None) -> ActiveValues:
        """Return the scaled singular values close to the bound; see `Barrier.active`."""
        gradients = config.robot.constraints.gradients(config.points)
        # The index has decreased at most by the norm of the change of the scaled gradients.
        if np.linalg.norm((gradients - self._gradients) * self._index.weights) < self._spare:
            return NO_ACTIVE_VALUES
        modes = self._index.modes(config)
        self._gradients, self._spare = gradients, modes.values[0] - self.law.active_below
        if self._spare >= 0.0:
            return NO_ACTIVE_VALUES
        count = int((modes.values < self.law.active_below).sum())  # they are the first ones
        active = Modes(modes.values[:count], modes.rows[:, :count], modes.nodes[:, :count])
        return ActiveValues(np.arange(count), active.values, self._index.gradients(config, active))

    def values(self, config: Configuration, grip: Grip | None, indices: Selection) -> Array:
        """Return the scaled singular values in ascending order; see `Barrier.values`."""
        return self._index.modes(config).values[indices]

    def names(self, indices: Indices) -> list[str]:
        """Return `the rigidity index` for each singular value; see `Barrier.names`."""
        return ['the rigidity index'] * len(indices)
