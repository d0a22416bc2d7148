# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What a barrier is, and how its margin may be used up: the control barrier function of all barriers.

A margin h is what is left between a value and the bound that it must not fall below. It may fall
at

    dh/dt >= -rate h / (1 - h / band),   h counted from a small safety margin on,

a class-K function of h: freely where more than `band` is left, slower and slower inside of it,
and not at all at the safety margin. A command holds for a sample, so there is a discrete-time
bound too: whatever the motion between two samples does to the margin in second order, a share of
it is left.
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
import numpy as np

#: Share of the band at which motion comes to rest, the safety margin: what is below is for effects
#: of second order.
SAFETY_SHARE = 0.01
#: Share of a margin, and of the safety margin, that is left after a sample, however long it is.
KEPT_SHARE = 0.1
#: What is beyond the bound must not get further, but for rounding and effects of second order: for
#: the square of the rollers' travel, in units of this [m], times the band.
ROUNDING, BEND = 1e-9, 0.05
#: Keeps shares of motions that change nothing finite.
TINY = 1e-15


@dataclass(frozen=True)
class BarrierLaw:
    """
    A bound on values, and how quickly they may approach it.

    :ivar bound: the smallest value that is allowed.
    :ivar band: a margin larger than this is not restricted, in units of the value.
    :ivar rate: a small margin shrinks by at most this share of itself in a second [1/s].
    """

    bound: float
    band: float
    rate: float = 5.0

    @cached_property
    def active_below(self) -> float:
        """Return the value below which it is restricted."""
        return self.bound + self.band

    @cached_property
    def safety_margin(self) -> float:
        """Return the margin at which motion comes to rest."""
        return SAFETY_SHARE * self.band

    def class_k_bound(self, margins: Array) -> Array:
        """
        Return how quickly margins may fall, not negative [1/s]; inf outside the band.

        :param margins: (k,).
        """
        return self._class_k(np.maximum(margins - self.safety_margin, 0.0))

    def discrete_bound(self, margins: Array, duration: float, travel: float) -> Array:
        """
        Return what must be left of margins after a sample.

        What has got down to `KEPT_SHARE` of the safety margin must not get further, nor may
        anything beyond the bound; so errors of a fraction of the safety margin do no harm. Below
        that share there is no safety margin for effects of second order: they are allowed there,
        or the robot would stop in every other sample, but not across the bound.

        :param margins: (k,) at its beginning.
        :param duration: of the sample, positive [s].
        :param travel: the largest of a roller in this sample or the one before it [m].
        """
        last = KEPT_SHARE * self.safety_margin
        left = np.maximum(margins, last)
        slowly = left - 2.0 * duration * self._class_k(left)
        kept = np.maximum(np.maximum(KEPT_SHARE * left, slowly), last)
        allowed = ROUNDING + self.band * (travel / BEND) ** 2
        # Many such effects must not lead across the bound either: what is left last is kept.
        floor = np.where(margins > 0.0, np.minimum(margins, KEPT_SHARE * last), -np.inf)
        beyond = np.maximum(margins - allowed, floor - ROUNDING)
        return np.where(margins > last, kept, beyond)

    def _class_k(self, left: Array) -> Array:
        share = np.minimum(left / self.band, 1.0)
        with np.errstate(divide='ignore'):
            return self.rate * left / (1.0 - share)


#: Numbers of values, or all of them.
Selection: TypeAlias = Indices | slice
EVERYTHING = slice(None)


class ActiveValues(NamedTuple):
    """
    The values of a barrier that are near their bound in one configuration.

    :ivar indices: (k,) numbers of the values.
    :ivar values: (k,) the values.
    :ivar node_rows: (k, 2n) their derivatives by the node coordinates.
    :ivar roller_rows: (k, r) those by the travel of the rollers besides; None for none.
    """

    indices: Indices
    values: Array
    node_rows: Array
    roller_rows: Array | None = None


NOTHING = ActiveValues(np.zeros(0, dtype=np.intp), np.zeros(0), np.zeros((0, 0)))


class Barrier(Protocol):
    """Values of a configuration that must not fall below a bound."""

    @property
    def status(self) -> Status:
        """Return the status of a command that this barrier slows."""

    @property
    def needs_object(self) -> bool:
        """
        Return whether the values depend on the object.

        Such a barrier counts only while one is held, which the guard then moves along a step.
        """

    @property
    def law(self) -> BarrierLaw:
        """Return the bound, and how it may be approached."""

    def active(self, config: Configuration, grip: Grip | None) -> ActiveValues:
        """
        Return the values within the band of the law, for a robot and what it holds.

        :param config: configuration of the robot.
        :param grip: the grip; None without an object.
        """

    def values(self, config: Configuration, grip: Grip | None, indices: Selection) -> Array:
        """
        Return values of these numbers in one configuration.

        :param config: configuration of the robot.
        :param grip: the grip; None without an object.
        :param indices: numbers of the values.
        """

    def names(self, indices: Indices) -> list[str]:
        """
        Return the names of the values of these numbers.

        :param indices: numbers of the values.
        """


class BarrierViolation(NamedTuple):
    """What keeps a motion from being admissible."""

    share: float  #: of the motion, which is admissible as far as one can tell
    status: Status  #: of a command that is slowed by it
    names: tuple[str, ...]  #: what would come too near to its bound


class BarrierLimit:
    """
    The active values of one barrier in one configuration, as a limit on the rollers.

    :ivar barrier: the barrier.
    :ivar indices: (k,) numbers of the values.
    :ivar matrix: (k, r) their derivatives by roller travel.
    :ivar margins: (k,) what is left of them.
    :param active: its values that are near their bound.
    """

    can_slide = True

    def __init__(self, barrier: Barrier, active: ActiveValues, matrix: Array) -> None:
        self.barrier, self.indices, self.matrix = barrier, active.indices, matrix
        self.margins = active.values - barrier.law.bound

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
    Return the share of a motion after which margins have fallen by the room that they have.

    A margin is taken for a parabola over the share, of which slope and end are known.

    :param room: not negative.
    :param slope: at the beginning, of the share.
    :param change: at the end.
    """
    root = np.sqrt(np.maximum(slope**2 - 4.0 * (change - slope) * room, 0.0))
    return np.minimum(2.0 * room / np.maximum(root - slope, TINY), 1.0)
