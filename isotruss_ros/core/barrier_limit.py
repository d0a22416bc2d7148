"""What is near a barrier in one configuration: a limit on the rollers, and on where they lead."""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.barriers import Barrier, Near
from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.grasp import Grasp
from isotruss_ros.core.limits import Rows
from isotruss_ros.core.status import Status
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Keeps shares of motions that change nothing finite.
TINY = 1e-15


class Crossed(NamedTuple):
    """
    What keeps a motion from being admissible.

    :ivar share: of the motion that seems admissible.
    :ivar status: of a command that is slowed by it.
    :ivar names: what would come too near to its bound.
    """

    share: float
    status: Status
    names: tuple[str, ...]


class BarrierLimit:
    """
    What is near one barrier in one configuration, as a limit on the rollers.

    :ivar barrier: the barrier.
    :ivar which: (k,) numbers of the values that are near their bound.
    :ivar matrix: (k, r) their derivatives by roller travel.
    :ivar margins: (k,) what is left of them.
    """

    def __init__(self, barrier: Barrier, near: Near, matrix: Array) -> None:
        self.barrier, self.which, self.matrix = barrier, near.which, matrix
        self.margins = barrier.boundary.margin(near.values)

    @property
    def status(self) -> Status:
        """Return the status of a command that this limit slows."""
        return self.barrier.status

    def rows(self, config: Configuration) -> Rows:
        """Return one row for each value; they hold where they were found."""
        fall = self.barrier.boundary.fall(self.margins)
        return Rows(self.matrix, -fall, np.full(len(fall), np.inf))

    def row_names(self, config: Configuration) -> tuple[str, ...]:
        """Return what the values speak of."""
        return tuple(self.barrier.names(self.which))

    def crossed(
        self, end: Configuration, grasp: Grasp, way: Array, velocities: Array, duration: float
    ) -> Crossed | None:
        """
        Tell whether a motion leaves less of the margins than it may, None where it does not.

        :param end: where it leads.
        :param grasp: what the robot holds there.
        :param way: (r,) of the rollers [m].
        :param velocities: (r,) of the rollers before it [m/s].
        :param duration: of the motion, in whose middle the rows were found [s].
        """
        boundary = self.barrier.boundary
        before = self.margins - 0.5 * duration * (self.matrix @ velocities)
        left = boundary.margin(self.barrier.values(end, grasp, self.which))
        floor = boundary.floor(before, duration)
        below = np.flatnonzero(left < floor)
        if not len(below):
            return None
        shares = _share(before - floor, self.matrix @ way, left - before)
        names = tuple(self.barrier.names(self.which[below]))
        return Crossed(float(shares[below].min()), self.status, names)


def _share(room: Array, slope: Array, change: Array) -> Array:
    """
    Return the share of a motion after which margins have fallen by the room that they have.

    A margin is taken for a parabola over the share, of which slope and end are known.

    :param room: not negative.
    :param slope: at the beginning, of the share.
    :param change: at the end.
    """
    root = np.sqrt(np.maximum(slope**2 - 4.0 * (change - slope) * room, 0.0))
    return np.minimum(2.0 * room / np.maximum(root - slope, TINY), 1.0)
