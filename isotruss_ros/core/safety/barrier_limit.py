# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The active values of a barrier as a limit on the rollers, and on where a command leads."""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.limits import Rows
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.safety.barrier_law import ActiveValues, Barrier
import numpy as np

#: Keeps shares of motions that change nothing finite.
TINY = 1e-15


class BarrierViolation(NamedTuple):
    """
    What keeps a motion from being admissible.

    :ivar share: of the motion, which is admissible as far as one can tell.
    :ivar status: of a command that is slowed by it.
    :ivar names: what would come too near to its bound.
    """

    share: float
    status: Status
    names: tuple[str, ...]


class BarrierLimit:
    """
    The active values of one barrier in one configuration, as a limit on the rollers.

    :ivar barrier: the barrier.
    :ivar indices: (k,) numbers of the values.
    :ivar matrix: (k, r) their derivatives by roller travel.
    :ivar margins: (k,) what is left of them.
    :param barrier: the barrier.
    :param active: its values that are near their bound.
    :param matrix: (k, r) their derivatives by roller travel.
    """

    can_slide = True

    def __init__(self, barrier: Barrier, active: ActiveValues, matrix: Array) -> None:
        self.barrier, self.indices, self.matrix = barrier, active.indices, matrix
        self.margins = barrier.law.margin(active.values)

    @property
    def status(self) -> Status:
        """Return the status of a command that this limit slows."""
        return self.barrier.status

    def rows(self, config: Configuration) -> Rows:
        """Return one row for each value, dh/dt >= -class-K bound; see `Limit.rows`."""
        bound = self.barrier.law.class_k_bound(self.margins)
        return Rows(self.matrix, -bound, np.full(len(bound), np.inf))

    def row_names(self, config: Configuration) -> tuple[str, ...]:
        """Return the names of the values; see `Limit.row_names`."""
        return tuple(self.barrier.names(self.indices))

    def violation(
        self,
        end: Configuration,
        grip: Grip | None,
        travel: Array,
        velocities: Array,
        duration: float,
    ) -> BarrierViolation | None:
        """
        Return how a motion violates the discrete-time bound, None where it does not.

        :param end: where it leads.
        :param grip: what the robot holds there; None without an object.
        :param travel: (r,) of the rollers in it [m].
        :param velocities: (r,) of the rollers before it [m/s].
        :param duration: of the motion, in whose middle the rows were found [s].
        """
        law = self.barrier.law
        before = self.margins - 0.5 * duration * (self.matrix @ velocities)
        left = law.margin(self.barrier.values(end, grip, self.indices))
        longest = max(float(np.abs(travel).max()), duration * float(np.abs(velocities).max()))
        bound = law.discrete_bound(before, duration, longest)
        below = np.flatnonzero(left < bound)
        if not len(below):
            return None
        shares = _admissible_share(before - bound, self.matrix @ travel, left - before)
        names = tuple(self.barrier.names(self.indices[below]))
        return BarrierViolation(float(shares[below].min()), self.status, names)


def _admissible_share(room: Array, slope: Array, change: Array) -> Array:
    """
    Return the share of a motion after which margins have fallen by the room that they have.

    A margin is taken for a parabola over the share, of which slope and end are known.

    :param room: not negative.
    :param slope: at the beginning, of the share.
    :param change: at the end.
    """
    root = np.sqrt(np.maximum(slope**2 - 4.0 * (change - slope) * room, 0.0))
    return np.minimum(2.0 * room / np.maximum(root - slope, TINY), 1.0)
