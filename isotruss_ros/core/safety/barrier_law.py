# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Barriers and the control barrier function of their margins.

A margin h is the difference between a value and its lower bound. Its rate is bounded by

    dh/dt >= -rate h / (1 - h / band),   h reduced by a small safety margin,

a class-K function of h: unbounded above `band`, zero at the safety margin. Since a command is
constant during a sample, a discrete-time bound applies as well: a share of the margin is left at
the end of the sample, including effects of second order.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol, TypeAlias

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.limits import Rows
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.numerics.tolerances import EPSILON, ROUNDING
import numpy as np

#: Safety margin, at which motion stops, as a share of the band [-]; covers effects of second
#: order.
SAFETY_MARGIN_SHARE = 0.01
#: Smallest share of a margin, and of the safety margin, left after a sample of any length [-].
LEFT_MARGIN = 0.1
#: Tolerance beyond the bound for effects of second order: the band times the squared travel of the
#: rollers in units of this length [m].
SECOND_ORDER_LENGTH = 0.05


@dataclass(frozen=True)
class BarrierLaw:
    """
    Lower bound of values, and bound of their rate of approach.

    :ivar bound: smallest allowed value.
    :ivar band: margin above which the rate is unbounded, in units of the value.
    :ivar rate: largest decay rate of a small margin [1/s].
    """

    bound: float
    band: float
    rate: float = 5.0

    @cached_property
    def active_below(self) -> float:
        """Return the value below which the rate is bounded."""
        return self.bound + self.band

    @cached_property
    def safety_margin(self) -> float:
        """Return the margin at which motion stops."""
        return SAFETY_MARGIN_SHARE * self.band

    def class_k_bound(self, margins: Array) -> Array:
        """
        Return the bound of the decrease of margins [1/s], infinite above the band.

        :param margins: (k,) margins.
        """
        return self._class_k(np.maximum(margins - self.safety_margin, 0.0))

    def discrete_bound(self, margins: Array, duration: float, travel: float) -> Array:
        """
        Return the smallest margins at the end of a sample.

        Margins below `LEFT_MARGIN` of the safety margin, or beyond the bound, must not
        decrease, so that errors of a fraction of the safety margin are harmless. Effects of second
        order are tolerated there (else the robot would stop in every other sample), but not across
        the bound.

        :param margins: (k,) margins at the start of the sample.
        :param duration: duration of the sample, positive [s].
        :param travel: largest travel of a roller in this or the previous sample [m].
        """
        last = LEFT_MARGIN * self.safety_margin
        left = np.maximum(margins, last)
        slowly = left - 2.0 * duration * self._class_k(left)
        kept = np.maximum(np.maximum(LEFT_MARGIN * left, slowly), last)
        allowed = ROUNDING + self.band * (travel / SECOND_ORDER_LENGTH) ** 2
        # The sum of such effects must not cross the bound: the last remainder is kept.
        floor = np.where(margins > 0.0, np.minimum(margins, LEFT_MARGIN * last), -np.inf)
        beyond = np.maximum(margins - allowed, floor - ROUNDING)
        return np.where(margins > last, kept, beyond)

    def _class_k(self, left: Array) -> Array:
        share = np.minimum(left / self.band, 1.0)
        with np.errstate(divide='ignore'):
            return self.rate * left / (1.0 - share)


#: Indices of values, or all values.
Selection: TypeAlias = Indices | slice
ALL_VALUES = slice(None)


class ActiveValues(NamedTuple):
    """
    Values of a barrier within its band in one configuration.

    :ivar indices: (k,) indices of the values.
    :ivar values: (k,) the values.
    :ivar node_rows: (k, 2n) derivatives by the node coordinates.
    :ivar roller_rows: (k, r) further derivatives by the travel of the rollers; None: zero.
    """

    indices: Indices
    values: Array
    node_rows: Array
    roller_rows: Array | None = None


NO_ACTIVE_VALUES = ActiveValues(np.zeros(0, dtype=np.intp), np.zeros(0), np.zeros((0, 0)))


class Barrier(Protocol):
    """A lower bound on functions of the configuration."""

    @property
    def status(self) -> Status:
        """Return the status of a command limited by this barrier."""

    @property
    def needs_object(self) -> bool:
        """
        Return whether the values depend on the object.

        Such a barrier applies only while an object is held, which the guard moves with the step.
        """

    @property
    def law(self) -> BarrierLaw:
        """Return the bound and the rate of approach."""

    def active(self, config: Configuration, grip: Grip | None) -> ActiveValues:
        """
        Return the values within the band of the law.

        :param config: configuration of the robot.
        :param grip: the grip; None without an object.
        """

    def values(self, config: Configuration, grip: Grip | None, indices: Selection) -> Array:
        """
        Return values by index in one configuration.

        :param config: configuration of the robot.
        :param grip: the grip; None without an object.
        :param indices: indices of the values.
        """

    def names(self, indices: Indices) -> list[str]:
        """
        Return the names of values by index.

        :param indices: indices of the values.
        """


class BarrierViolation(NamedTuple):
    """Violation of a barrier by a motion."""

    share: float  #: admissible share of the motion
    status: Status  #: status of a command limited by it
    names: tuple[str, ...]  #: name of the value


class BarrierLimit:
    """
    Active values of one barrier in one configuration, as a limit on the rollers.

    :ivar barrier: the barrier.
    :ivar indices: (k,) indices of the values.
    :ivar matrix: (k, r) derivatives by roller travel.
    :ivar margins: (k,) margins of the values.
    :param active: values within the band.
    """

    can_slide = True

    def __init__(self, barrier: Barrier, active: ActiveValues, matrix: Array) -> None:
        self.barrier, self.indices, self.matrix = barrier, active.indices, matrix
        self.margins = active.values - barrier.law.bound

    @property
    def status(self) -> Status:
        """Return the status of a command limited by this limit."""
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
        Return the violation of the discrete-time bound by a motion, None if admissible.

        :param end: configuration at its end.
        :param grip: grip at its end; None without an object.
        :param travel: (r,) roller travel of the motion [m].
        :param velocities: (r,) roller velocities before it [m/s].
        :param duration: duration of the motion; the rows are those of its midpoint [s].
        """
        law = self.barrier.law
        before = self.margins - 0.5 * duration * (self.matrix @ velocities)
        left = self.barrier.values(end, grip, self.indices) - law.bound
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
    Return the share of a motion at which the decrease of margins reaches its bound.

    The margin is interpolated by a parabola in the share, from slope and end value.

    :param room: allowed decrease, not negative.
    :param slope: derivative by the share at the start.
    :param change: change at the end.
    """
    root = np.sqrt(np.maximum(slope**2 - 4.0 * (change - slope) * room, 0.0))
    return np.minimum(2.0 * room / np.maximum(root - slope, EPSILON), 1.0)
