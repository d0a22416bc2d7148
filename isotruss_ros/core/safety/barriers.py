"""Barriers: values of a configuration that must not fall below a bound."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol, TypeAlias

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.rigidity import Modes, rigidity_index
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.grasp import Grasp
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.manipulation.task import grasp_rows
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.safety.barrier_law import BarrierLaw
from isotruss_ros.core.safety.distances import collision_model
from isotruss_ros.core.safety.neighbor_list import NeighborList
import numpy as np

#: Numbers of values, or all of them.
Selection: TypeAlias = Indices | slice
EVERYTHING = slice(None)


class ActiveValues(NamedTuple):
    """
    The values of a barrier that are near their bound in one configuration.

    :ivar indices: (k,) numbers of the values.
    :ivar values: (k,) the values.
    :ivar node_rows: (k, 2n) their derivatives by the node coordinates.
    """

    indices: Indices
    values: Array
    node_rows: Array


NOTHING = ActiveValues(np.zeros(0, dtype=np.intp), np.zeros(0), np.zeros((0, 0)))


class Barrier(Protocol):
    """Values of a configuration that must not fall below a bound."""

    @property
    def status(self) -> Status:
        """Return the status of a command that this barrier slows."""

    @property
    def law(self) -> BarrierLaw:
        """Return the bound, and how it may be approached."""

    def active(self, config: Configuration, grasp: Grasp | None) -> ActiveValues:
        """
        Return the values within the band of the law, for a robot and what it holds.

        :param config: configuration of the robot.
        :param grasp: the grasp; None without an object.
        """

    def values(self, config: Configuration, grasp: Grasp | None, indices: Selection) -> Array:
        """
        Return values of these numbers in one configuration.

        :param config: configuration of the robot.
        :param grasp: the grasp; None without an object.
        :param indices: numbers of the values.
        """

    def names(self, indices: Indices) -> list[str]:
        """
        Return the names of the values of these numbers.

        :param indices: numbers of the values.
        """


def find_active(
    barriers: Sequence[Barrier], config: Configuration, grasp: Grasp | None
) -> list[tuple[Barrier, ActiveValues]]:
    """
    Return the barriers that have values near their bound, with these.

    :param barriers: the barriers.
    :param config: configuration of the robot.
    :param grasp: the grasp; None without an object.
    """
    found = [(barrier, barrier.active(config, grasp)) for barrier in barriers]
    return [(barrier, active) for barrier, active in found if len(active.indices)]


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
        if self._neighbors is None or not self._neighbors.is_valid(config, None):
            everything = self._model.distances(config)
            self._neighbors = NeighborList.find(config, None, everything, near)
        pairs = self._neighbors.pairs
        if not len(pairs):
            return NOTHING
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
        if self._neighbors is None or not self._neighbors.is_valid(config, grasp):
            everything = self.values(config, grasp, EVERYTHING)
            self._neighbors = NeighborList.find(config, grasp, everything, near)
        if not len(self._neighbors.pairs):
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
