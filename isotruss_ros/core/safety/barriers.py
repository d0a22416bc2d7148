"""Barriers: rigidity, distances between parts of the robot, and to the object that it holds."""

from __future__ import annotations

import math
from typing import NamedTuple

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.rigidity import Modes, rigidity_index
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.grasp import Grasp
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.manipulation.task import grasp_rows
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.safety.barrier_law import (
    ActiveValues,
    BarrierLaw,
    EVERYTHING,
    NOTHING,
    Selection,
)
from isotruss_ros.core.safety.distances import collision_model
import numpy as np

#: Pairs that are this much farther apart than near are in the list too [m].
SKIN = 0.05


class NeighborList(NamedTuple):
    """
    The pairs that could come near, found where the robot was a while ago (Verlet's list).

    It saves work and changes no result: the distance of two parts changes by no more than
    what both of them have moved.

    :ivar config: where the robot was.
    :ivar grasp: what it held.
    :ivar spare: how far from being near all other pairs were, at least [m].
    :ivar clear: the same of the pairs in the list; not positive where some were near.
    :ivar pairs: (k,) numbers of the pairs in the list.
    """

    config: Configuration
    grasp: Grasp | None
    spare: float
    clear: float
    pairs: Indices

    @classmethod
    def find(
        cls, config: Configuration, grasp: Grasp | None, distances: Array, near: float
    ) -> NeighborList:
        """
        Make the list.

        :param config: where the robot is.
        :param grasp: what it holds; None where no distance depends on that.
        :param distances: of all pairs there [m].
        :param near: pairs closer than this are near [m].
        """
        pairs = np.flatnonzero(distances < near + SKIN)
        clear = float(distances.min(initial=np.inf)) - near
        return cls(config, grasp, SKIN if len(pairs) else clear, clear, pairs)

    def motion(self, config: Configuration, grasp: Grasp | None) -> float:
        """
        Return by how much distances have changed since, at most [m]; infinite for another object.

        :param config: where the robot is.
        :param grasp: what it holds, None as in `find`.
        """
        then = self.grasp
        moved = float(np.abs(config.points - self.config.points).max())
        if grasp is None or then is None:
            return 2.0 * moved if grasp is then else math.inf
        if grasp.module != then.module or grasp.diameter != then.diameter:
            return math.inf
        return moved + max(moved, math.dist(grasp.center, then.center))


class RigidityBarrier:
    """
    The shape stays rigid, see `rigidity_index`.

    All singular values that are near the bound count: where two are close, the one that is
    the smallest after a step may be another than before it.

    :param robot: the robot.
    :param law: of the rigidity index, which is 1 at home [-].
    """

    status = Status.SLOWED_RIGIDITY

    def __init__(self, robot: Robot, law: BarrierLaw) -> None:
        self.law = law
        self._index = rigidity_index(robot)
        self._far: tuple[Configuration, float] | None = None

    def active(self, config: Configuration, grasp: Grasp | None) -> ActiveValues:
        """
        Return the least rigid modes.

        :param config: where the robot is.
        :param grasp: not used.
        """
        if self._far is not None and self._index.change(config, self._far[0]) < self._far[1]:
            return NOTHING
        modes = self._index.modes(config)
        spare = float(modes.values[0]) - self.law.active_below
        self._far = (config, spare) if spare > 0.0 else None
        if spare >= 0.0:
            return NOTHING
        count = int((modes.values < self.law.active_below).sum())
        few = Modes(modes.values[:count], modes.rows[:, :count], modes.nodes[:, :count])
        return ActiveValues(np.arange(count), few.values, self._index.gradients(config, few))

    def values(self, config: Configuration, grasp: Grasp | None, indices: Selection) -> Array:
        """
        Return the rigidity index of modes, least first.

        :param config: where the robot is.
        :param grasp: not used.
        :param indices: of the modes.
        """
        return self._index.modes(config).values[indices]

    def names(self, indices: Indices) -> list[str]:
        """
        Return one name for all.

        :param indices: of the modes.
        """
        return ['the rigidity of the shape'] * len(indices)


class SelfCollisionBarrier:
    """
    Parts of the robot stay apart, see `CollisionModel`.

    :param robot: the robot.
    :param law: of the distance between surfaces [m].
    """

    status = Status.SLOWED_SELF_COLLISION

    def __init__(self, robot: Robot, law: BarrierLaw) -> None:
        self.law = law
        self._model = collision_model(robot)
        self._neighbors: NeighborList | None = None

    def active(self, config: Configuration, grasp: Grasp | None) -> ActiveValues:
        """
        Return the pairs that are close.

        :param config: where the robot is.
        :param grasp: not used.
        """
        near = self.law.active_below
        found = self._neighbors
        motion = math.inf if found is None else found.motion(config, None)
        if found is None or motion >= found.spare:
            found = NeighborList.find(config, None, self._model.distances(config), near)
            self._neighbors, motion = found, 0.0
        if motion < found.clear:
            return NOTHING
        pairs = found.pairs
        distances = self._model.distances(config, pairs)
        close = distances < near
        if not close.any():
            return NOTHING
        pairs = pairs[close]
        return ActiveValues(pairs, distances[close], self._model.gradients(config, pairs))

    def values(self, config: Configuration, grasp: Grasp | None, indices: Selection) -> Array:
        """
        Return the distances of pairs [m].

        :param config: where the robot is.
        :param grasp: not used.
        :param indices: of the pairs.
        """
        return self._model.distances(config, indices)

    def names(self, indices: Indices) -> list[str]:
        """
        Return the names of pairs.

        :param indices: of the pairs.
        """
        return self._model.names(indices)


class ObjectBarrier:
    """
    The robot stays clear of the object that it holds, beside the grip; see `CollisionModel`.

    :param robot: the robot.
    :param law: of the distance between surfaces [m].
    """

    status = Status.SLOWED_OBJECT

    def __init__(self, robot: Robot, law: BarrierLaw) -> None:
        self.law = law
        self._model = collision_model(robot)
        self._neighbors: NeighborList | None = None

    def active(self, config: Configuration, grasp: Grasp) -> ActiveValues:
        """
        Return the parts that are close to the object.

        :param config: where the robot is.
        :param grasp: what it holds.
        """
        near = self.law.active_below
        found = self._neighbors
        motion = math.inf if found is None else found.motion(config, grasp)
        if found is None or motion >= found.spare:
            everything = self.values(config, grasp, EVERYTHING)
            found = NeighborList.find(config, grasp, everything, near)
            self._neighbors, motion = found, 0.0
        if motion < found.clear:
            return NOTHING
        distances = self.values(config, grasp, EVERYTHING)
        parts = np.flatnonzero(distances < near)
        if not len(parts):
            return NOTHING
        motion = grasp_rows(config, grasp).nodes[:2]
        rows = self._model.object_gradients(config, complex(*grasp.center), parts, motion)
        return ActiveValues(parts, distances[parts], rows)

    def values(self, config: Configuration, grasp: Grasp, indices: Selection) -> Array:
        """
        Return the distances of parts from the object; inf for those at the grip [m].

        :param config: where the robot is.
        :param grasp: what it holds.
        :param indices: of the parts.
        """
        return self._model.object_distances(config, grasp, grasp.module)[indices]

    def names(self, indices: Indices) -> list[str]:
        """
        Return the names of parts.

        :param indices: of the parts.
        """
        names = self._model.part_names()
        return [f'{names[i]} and the object' for i in indices]
