"""What closes on an object, and where the robot is then."""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core.clearance import bodies
from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.grasp_analysis import Cylinder
from isotruss_ros.core.limits import Limit
from isotruss_ros.core.object_gaps import object_gaps, ObjectGaps
from isotruss_ros.core.shape_rigidity import Modes, shape_rigidity
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Closing:
    """
    What is to close on what, under which bounds.

    :ivar cylinder: the object, which stands still.
    :ivar module: the grip module.
    :ivar sides: the members that are to touch: the two at the module, and perhaps others.
    :ivar opening: largest angle between the two sides [rad].
    :ivar limits: of the rollers; a step is their motion in a unit of time.
    :ivar min_rigidity: see `shape_rigidity`.
    :ivar pull: (r,) roller positions toward which what is left free is drawn; where the robot
        is if None [m].
    """

    cylinder: Cylinder
    module: int
    sides: tuple[int, ...]
    opening: float
    limits: tuple[Limit, ...]
    min_rigidity: float
    pull: Array | None = None

    def bound(self, requirement: str) -> float:
        """Return what a step needs of a requirement that blocks it."""
        return {'rigidity': self.min_rigidity, 'opening': self.opening}.get(requirement, 0.0)


@dataclass(frozen=True, eq=False)
class Place:
    """
    A configuration, and all that a step from it or to it asks about.

    :ivar config: where the robot is.
    :ivar gaps: between it and the object.
    :ivar modes: its least rigid ways to move.
    :ivar distances: (p,) of parts that must not meet, see `clearance` [m].
    """

    config: Configuration
    gaps: ObjectGaps
    modes: Modes
    distances: Array

    @property
    def rigidity(self) -> float:
        """Return the rigidity, 1 at home."""
        return float(self.modes.values[0])

    @property
    def clearance(self) -> float:
        """Return the least of the distances [m]."""
        return float(self.distances.min(initial=np.inf))


def look_at(config: Configuration, cylinder: Cylinder) -> Place:
    """
    Return what is to be known about a configuration.

    :raises ConfigurationError: it is singular.
    """
    return Place(
        config,
        object_gaps(config, cylinder),
        shape_rigidity(config.robot).modes(config),
        bodies(config.robot).distances(config),
    )


def scale(config: Configuration) -> float:
    """Return the mean length of the members at home [m], by which steps are measured."""
    return float(config.robot.home.member_lengths.mean())
