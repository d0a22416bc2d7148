# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Barriers, and the control barrier function that bounds the rate of their margins.

A margin is the difference between a value of the barrier and the lower bound. Let h be a margin
minus a small safety margin. The rate of h is bounded from below:

    dh/dt >= -rate h / (1 - h / band)

The right-hand side is a class-K function of h: at h = 0 no decrease is allowed, and from h = band
on the rate is not bounded. A command is constant during a sample, so a discrete-time bound applies
as well: a fraction of the margin must remain at the end of the sample, including effects of second
order.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol, TypeAlias

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.limits import Rows
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices
from isotruss_ros.core.numerics.tolerances import EPSILON, ROUNDING
import numpy as np

#: Safety margin at which no further decrease is allowed, as a fraction of the band [-]; it covers
#: effects of second order.
SAFETY_MARGIN_SHARE = 0.01
#: Smallest fraction of a margin, and of the safety margin, that must remain after a sample of any
#: length [-].
MIN_MARGIN_SHARE = 0.1
#: Roller travel at which effects of second order are as large as the band [m]; the effects grow
#: with the square of the travel.
SECOND_ORDER_LENGTH = 0.05


@dataclass(frozen=True)
class BarrierLaw:
    """Lower bound of a barrier's values, and bound of the rate at which the values approach it."""

    bound: float  #: smallest allowed value of the barrier function
    band: float  #: margin above which the rate is not bounded, in the unit of the value
    rate: float = 5.0  #: largest decay rate of a small margin [1/s]
    is_distance: bool = False  #: whether the values are distances between surfaces [m]

    @cached_property
    def active_below(self) -> float:
        """Return the barrier value below which the rate of decrease is bounded."""
        return self.bound + self.band

    @cached_property
    def safety_margin(self) -> float:
        """Return the margin above the bound at which a barrier value must not decrease further."""
        return SAFETY_MARGIN_SHARE * self.band

    def class_k_bound(self, margins: Array) -> Array:
        """Return the largest rates of decrease (k,) at margins (k,), infinite beyond the band."""
        excess = np.maximum(margins - self.safety_margin, 0.0)
        share = 1.0 - excess / self.band
        bounds = np.full(len(excess), np.inf)
        return np.divide(self.rate * excess, share, out=bounds, where=share > 0.0)

    def discrete_bound(self, margins: Array, duration: float, travel: float) -> Array:
        """
        Return the smallest admissible margins (k,) after a sample that begins with `margins` (k,).

        A margin below `MIN_MARGIN_SHARE` times the safety margin must not decrease, except by
        effects of second order, because otherwise the robot would stop in every other sample. A
        positive margin must stay positive. The travel is the largest one of this or the previous
        sample [m].
        """
        small = MIN_MARGIN_SHARE * self.safety_margin
        # Margins above `small` decrease by at most twice the class-K rate toward zero (without the
        # safety margin), and to no less than a fraction or `small`.
        decay = 2.0 * duration * self.class_k_bound(margins + self.safety_margin)
        bounds = np.maximum(np.maximum(MIN_MARGIN_SHARE * margins, margins - decay), small)
        # Smaller margins decrease by effects of second order only. A positive margin keeps a
        # remainder, so that the sum of such effects does not cross the bound.
        second_order = ROUNDING + self.band * (travel / SECOND_ORDER_LENGTH) ** 2
        remainder = np.where(margins > 0.0, np.minimum(margins, MIN_MARGIN_SHARE * small), -np.inf)
        bounds_of_small = np.maximum(margins - second_order, remainder - ROUNDING)
        return np.where(margins > small, bounds, bounds_of_small)


#: Indices of values; a slice for all values.
Selection: TypeAlias = Indices | slice
ALL_VALUES = slice(None)


class ActiveValues(NamedTuple):
    """Values of a barrier that are so close to its bound that their rate is limited."""

    indices: Indices  #: (k,) indices of the values among the barrier's values
    values: Array  #: (k,) values of the barrier function
    #: (k, 2n) derivatives of the values with respect to node coordinates x0, y0, x1, y1, ...
    node_rows: Array
    #: (k, r) derivatives of the values with respect to roller travel with fixed nodes, or zero
    roller_rows: Array | float = 0.0
    #: (k,) rates of the values while the robot is at rest, by the motion of obstacles [1/s]; None:
    #: nothing moves but the robot
    drift: Array | None = None


NO_ACTIVE_VALUES = ActiveValues(np.zeros(0, dtype=np.intp), np.zeros(0), np.zeros((0, 0)))


class Barrier(Protocol):
    """Protocol of barriers, each a lower bound on one or more functions of the configuration."""

    status: Status  #: status code of a command that this barrier reduces
    #: whether the values depend on a held object; then the barrier applies only with an object
    needs_object: bool
    law: BarrierLaw  #: bound of the values, and bound of their rate of decrease

    def active(self, config: Configuration, grip: Grip | None) -> ActiveValues:
        """
        Return the barrier's values that are so close to the bound that their rate is limited.

        :param config: configuration of the robot.
        :param grip: the grip; None without an object.
        """

    def values(self, config: Configuration, grip: Grip | None, indices: Selection) -> Array:
        """
        Return the barrier's values with given indices in one configuration.

        :param config: configuration of the robot.
        :param grip: the grip; None without an object.
        :param indices: indices of the values.
        """

    def names(self, indices: Indices) -> list[str]:
        """
        Return a name for each of the barrier's values with given indices.

        :param indices: indices of the values.
        """


class BarrierViolation(NamedTuple):
    """Violation of a barrier by a motion."""

    share: float  #: largest admissible fraction of the motion
    status: Status  #: status of a command that the barrier reduces
    names: tuple[str, ...]  #: names of the violated values, such as two parts of the robot


class BarrierLimit:
    """
    Limit on roller speeds due to those values of one barrier that are close to its bound.

    :ivar matrix: (k, r) derivatives of the values with respect to roller travel.
    :param rows: (k, r) derivatives with respect to roller travel by the motion of the nodes.
    """

    can_slide = True

    def __init__(self, barrier: Barrier, active: ActiveValues, rows: Array) -> None:
        self.barrier, self.indices = barrier, active.indices
        self.matrix = rows + active.roller_rows
        self.margins = active.values - barrier.law.bound  #: (k,) margins of the values
        self.status = barrier.status  #: status of a command that this limit reduces
        #: lower bounds (k,) of the rates by which rollers change the values [1/s]; they are
        #: positive if an obstacle approaches faster than the law allows, see `evade`
        self.required = -barrier.law.class_k_bound(self.margins)
        if active.drift is not None:
            # An obstacle that recedes allows no faster approach.
            self.required = self.required - np.minimum(active.drift, 0.0)

    def take(self, chosen: Flags) -> BarrierLimit:
        """Return the limit on chosen values (k,)."""
        taken = copy.copy(self)
        taken.indices, taken.matrix = self.indices[chosen], self.matrix[chosen]
        taken.margins, taken.required = self.margins[chosen], self.required[chosen]
        return taken

    def rows(self, config: Configuration) -> Rows:
        """Return one row for each barrier value, which zero speed fulfils; see `Limit.rows`."""
        bound = np.minimum(self.required, 0.0)
        return Rows(self.matrix, bound, np.full(len(bound), np.inf))

    def row_names(self, config: Configuration) -> tuple[str, ...]:
        """Return the names of the barrier's values; see `Limit.row_names`."""
        return tuple(self.barrier.names(self.indices))

    def violation(
        self, end: Configuration, grip: Grip | None, travel: Array, speeds: Array, duration: float
    ) -> BarrierViolation | None:
        """
        Return the violation of `BarrierLaw.discrete_bound` by a motion; None if there is none.

        The limit is linearised at the midpoint of the motion, which roller `speeds` (r,) predict.
        """
        longest = max(float(np.abs(travel).max()), duration * float(np.abs(speeds).max()))
        start_margins, bounds = self._discrete_bounds(speeds, duration, longest)
        end_margins = self.barrier.values(end, grip, self.indices) - self.barrier.law.bound
        violated = np.flatnonzero(end_margins < bounds)
        if not len(violated):
            return None
        # After a share s of the motion, the excess of a margin over its bound is c + b s + a s^2;
        # its first zero is 2 c / (sqrt(b^2 - 4 a c) - b).
        c, b = start_margins - bounds, self.matrix @ travel
        a = end_margins - start_margins - b
        root = np.sqrt(np.maximum(b**2 - 4.0 * a * c, 0.0))
        shares = np.minimum(2.0 * c / np.maximum(root - b, EPSILON), 1.0)
        names = tuple(self.barrier.names(self.indices[violated]))
        return BarrierViolation(float(shares[violated].min()), self.status, names)

    def may_violate(self, approach: float, speeds: Array, duration: float) -> Flags:
        """
        Return which values (k,) a motion may take below their `BarrierLaw.discrete_bound`.

        From the midpoint to the end of the motion, surfaces `approach` by at most a distance [m].
        """
        if not self.barrier.law.is_distance:
            return np.ones(len(self.margins), dtype=bool)
        travel = duration * float(np.abs(speeds).max())  # a longer one has lower bounds
        _, bounds = self._discrete_bounds(speeds, duration, travel)
        return self.margins - approach < bounds

    def _discrete_bounds(
        self, speeds: Array, duration: float, travel: float
    ) -> tuple[Array, Array]:
        """Return the margins (k,) at the start of a motion, and the bounds (k,) at its end."""
        start_margins = self.margins - 0.5 * duration * (self.matrix @ speeds)
        return start_margins, self.barrier.law.discrete_bound(start_margins, duration, travel)
