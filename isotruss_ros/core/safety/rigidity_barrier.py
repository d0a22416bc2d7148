# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The barrier of rigidity: the locked robot must not become a mechanism."""

from __future__ import annotations

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.rigidity import Modes, rigidity_index
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.safety.barrier_law import ActiveValues, BarrierLaw, NOTHING, Selection
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
        """Return the least rigid modes; see `Barrier.active`."""
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
        """Return the rigidity index of modes, least first; see `Barrier.values`."""
        return self._index.modes(config).values[indices]

    def names(self, indices: Indices) -> list[str]:
        """Return one name for all; see `Barrier.names`."""
        return ['the rigidity of the shape'] * len(indices)
