# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Barriers: rigidity, distances between parts of the robot, and to the object that it holds."""

from __future__ import annotations

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.rigidity import Modes, rigidity_index
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.safety.barrier_law import (
    ActiveValues,
    BarrierLaw,
    NOTHING,
    Selection,
)
from isotruss_ros.core.safety.distances import collision_model
from isotruss_ros.core.safety.neighbor_list import NeighborList, SKIN
from isotruss_ros.core.safety.object_distances import grip_gradients, object_distances
import numpy as np


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

    def __init__(self, robot: Robot, law: BarrierLaw) -> None:
        self.law = law
        self._index = rigidity_index(robot)
        self._far: tuple[Configuration, float] | None = None

    def active(self, config: Configuration, grip: Grip | None) -> ActiveValues:
        """
        Return the least rigid modes.

        :param config: where the robot is.
        :param grip: not used.
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

    def values(self, config: Configuration, grip: Grip | None, indices: Selection) -> Array:
        """
        Return the rigidity index of modes, least first.

        :param config: where the robot is.
        :param grip: not used.
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
    needs_object = False

    def __init__(self, robot: Robot, law: BarrierLaw) -> None:
        self.law = law
        self._model = collision_model(robot)
        self._neighbors = NeighborList(law.active_below)

    def active(self, config: Configuration, grip: Grip | None) -> ActiveValues:
        """
        Return the pairs that are close.

        :param config: where the robot is.
        :param grip: not used.
        """
        pairs, distances = self._neighbors.find_close(
            config, None, lambda indices: self.values(config, grip, indices)
        )
        if not len(pairs):
            return NOTHING
        return ActiveValues(pairs, distances, self._model.gradients(config, pairs))

    def values(self, config: Configuration, grip: Grip | None, indices: Selection) -> Array:
        """
        Return the distances of pairs [m].

        :param config: where the robot is.
        :param grip: not used.
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
    needs_object = True

    def __init__(self, robot: Robot, law: BarrierLaw) -> None:
        self.law = law
        self._model = collision_model(robot)
        self._neighbors = NeighborList(law.active_below)

    def active(self, config: Configuration, grip: Grip) -> ActiveValues:
        """
        Return the parts that are close to the object.

        :param config: where the robot is.
        :param grip: what it holds.
        """
        parts, distances = self._neighbors.find_close(
            config, grip, lambda indices: self.values(config, grip, indices)
        )
        if not len(parts):
            return NOTHING
        return ActiveValues(parts, distances, *grip_gradients(config, grip, parts))

    def values(self, config: Configuration, grip: Grip, indices: Selection) -> Array:
        """
        Return the distances of parts from the object; inf for those at the grip [m].

        :param config: where the robot is.
        :param grip: what it holds.
        :param indices: of the parts.
        """
        far = self.law.active_below + SKIN
        return object_distances(config, grip.body, grip.members, far, indices)

    def names(self, indices: Indices) -> list[str]:
        """
        Return the names of parts.

        :param indices: of the parts.
        """
        names = self._model.part_names()
        return [f'{names[i]} and the object' for i in indices]
