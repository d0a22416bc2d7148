"""Barriers: the shapes that a robot must not take, as values that must not fall below a bound."""

from __future__ import annotations

from typing import NamedTuple, Protocol, TypeAlias

from isotruss_ros.core.boundary import Boundary
from isotruss_ros.core.clearance import bodies
from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.grasp import Grasp
from isotruss_ros.core.robot import Robot
from isotruss_ros.core.shape_rigidity import Modes, shape_rigidity
from isotruss_ros.core.status import Status
from isotruss_ros.core.survey import Survey, survey
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

#: Numbers of values, or all of them.
Which: TypeAlias = Indices | slice
EVERYTHING = slice(None)


class Near(NamedTuple):
    """
    What is near its bound in one configuration.

    :ivar which: (k,) numbers of the values.
    :ivar values: (k,) the values.
    :ivar node_rows: (k, 2n) their derivatives by the node coordinates.
    """

    which: Indices
    values: Array
    node_rows: Array


NOTHING = Near(np.zeros(0, dtype=np.intp), np.zeros(0), np.zeros((0, 0)))


class Barrier(Protocol):
    """Values of a configuration that must not fall below a bound."""

    @property
    def status(self) -> Status:
        """Return the status of a command that this barrier slows."""

    @property
    def boundary(self) -> Boundary:
        """Return the bound, and how it is come to."""

    def near(self, config: Configuration, grasp: Grasp) -> Near:
        """Return the values within the band of the boundary."""

    def values(self, config: Configuration, grasp: Grasp, which: Which) -> Array:
        """Return values of these numbers in one configuration."""

    def names(self, which: Indices) -> list[str]:
        """Return what the values of these numbers speak of."""


class RigidityBarrier:
    """
    The shape stays rigid, see `shape_rigidity`.

    Of the singular values all that are near the bound count: where two are close, the one that is
    the smallest after a step may be another than before it.

    :param robot: the robot.
    :param boundary: of the rigidity, which is 1 at home [-].
    """

    status = Status.SLOWED_RIGIDITY

    def __init__(self, robot: Robot, boundary: Boundary) -> None:
        self.boundary = boundary
        self._measure = shape_rigidity(robot)
        self._far: tuple[Configuration, float] | None = None

    def near(self, config: Configuration, grasp: Grasp) -> Near:
        """Return the least rigid modes."""
        if self._far is not None and self._measure.change(config, self._far[0]) < self._far[1]:
            return NOTHING
        modes = self._measure.modes(config)
        spare = float(modes.values[0]) - self.boundary.end
        self._far = (config, spare) if spare > 0.0 else None
        if spare >= 0.0:
            return NOTHING
        count = int((modes.values < self.boundary.end).sum())
        few = Modes(modes.values[:count], modes.rows[:, :count], modes.nodes[:, :count])
        return Near(np.arange(count), few.values, self._measure.gradients(config, few))

    def values(self, config: Configuration, grasp: Grasp, which: Which) -> Array:
        """Return the rigidity of modes, least first."""
        return self._measure.modes(config).values[which]

    def names(self, which: Indices) -> list[str]:
        """Return one name for all."""
        return ['the rigidity of the shape'] * len(which)


class CrossingBarrier:
    """
    Parts of the robot stay apart, see `clearance`.

    :param robot: the robot.
    :param boundary: of the distance between surfaces [m].
    """

    status = Status.SLOWED_CROSSING

    def __init__(self, robot: Robot, boundary: Boundary) -> None:
        self.boundary = boundary
        self._bodies = bodies(robot)
        self._survey: Survey | None = None

    def near(self, config: Configuration, grasp: Grasp) -> Near:
        """Return the pairs that are close."""
        if self._survey is None or not self._survey.holds(config, grasp):
            everything = self._bodies.distances(config)
            self._survey = survey(config, grasp, everything, self.boundary.end)
        close = self._survey.close
        distances = self._bodies.distances(config, close) if len(close) else NOTHING.values
        near = distances < self.boundary.end
        if not near.any():
            return NOTHING
        which = close[near]
        return Near(which, distances[near], self._bodies.gradients(config, which))

    def values(self, config: Configuration, grasp: Grasp, which: Which) -> Array:
        """Return the distances of pairs [m]."""
        return self._bodies.distances(config, None if isinstance(which, slice) else which)

    def names(self, which: Indices) -> list[str]:
        """Return the names of the pairs."""
        return self._bodies.names(which)


class ObjectBarrier:
    """
    The robot stays clear of the object that it holds, beside the grip; see `clearance`.

    :param robot: the robot.
    :param boundary: of the distance between surfaces [m].
    """

    status = Status.SLOWED_OBJECT

    def __init__(self, robot: Robot, boundary: Boundary) -> None:
        self.boundary = boundary
        self._bodies = bodies(robot)
        self._survey: Survey | None = None

    def near(self, config: Configuration, grasp: Grasp) -> Near:
        """Return the members and modules that are close."""
        if self._survey is None or not self._survey.holds(config, grasp):
            everything = self.values(config, grasp, EVERYTHING)
            self._survey = survey(config, grasp, everything, self.boundary.end)
        if not len(self._survey.close):
            return NOTHING
        distances = self.values(config, grasp, EVERYTHING)
        which = np.flatnonzero(distances < self.boundary.end)
        if not len(which):
            return NOTHING
        rows = self._bodies.object_gradients(config, grasp, which)
        return Near(which, distances[which], rows)

    def values(self, config: Configuration, grasp: Grasp, which: Which) -> Array:
        """Return the distances of members and modules; inf for those at the grip [m]."""
        return self._bodies.object_distances(config, grasp, grasp.module)[which]

    def names(self, which: Indices) -> list[str]:
        """Return the names of the members and modules."""
        names = self._bodies.object_names()
        return [f'{names[i]} and the object' for i in which]
