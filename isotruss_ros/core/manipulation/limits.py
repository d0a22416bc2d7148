# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Limits on the roller speeds: each hands the quadratic program rows lower <= G phidot <= upper.

Zero speed fulfils every limit: a robot beyond a bound may stay there or return, not go further.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import functools
from functools import cached_property
from typing import ClassVar, NamedTuple, Protocol

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices
import numpy as np


class Rows(NamedTuple):
    """
    Rows lower <= matrix @ phidot <= upper, with lower <= 0 <= upper.

    :ivar matrix: (k, r) on the roller speeds [-].
    :ivar lower: (k,) [m/s].
    :ivar upper: (k,) [m/s].
    """

    matrix: Array
    lower: Array
    upper: Array


NO_ROWS = np.zeros(0)


class StackedRows:
    """
    The rows of several limits, one limit after the other.

    :ivar parts: the rows of each limit.
    :param parts: the rows of each limit.
    """

    def __init__(self, parts: Sequence[Rows]) -> None:
        self.parts = parts

    @cached_property
    def matrix(self) -> Array:
        """Return the (k, r) rows on the roller speeds [-]."""
        return np.concatenate([part.matrix for part in self.parts])

    @cached_property
    def lower(self) -> Array:
        """Return the (k,) lower bounds [m/s]."""
        return np.concatenate([NO_ROWS, *(part.lower for part in self.parts)])

    @cached_property
    def upper(self) -> Array:
        """Return the (k,) upper bounds [m/s]."""
        return np.concatenate([NO_ROWS, *(part.upper for part in self.parts)])

    @cached_property
    def limit(self) -> Indices:
        """Return the (k,) numbers of the limits that rows belong to."""
        return np.arange(len(self.parts)).repeat([len(part.upper) for part in self.parts])

    def scaled(self, unit: float, largest: float) -> StackedRows:
        """
        Return the same rows, with bounds in another unit.

        :param unit: of the bounds [m/s].
        :param largest: what takes the place of larger bounds, in that unit.
        """
        with np.errstate(over='ignore'):
            return StackedRows(
                [
                    Rows(
                        part.matrix,
                        np.maximum(part.lower / unit, -largest),
                        np.minimum(part.upper / unit, largest),
                    )
                    for part in self.parts
                ]
            )

    def rates(self, velocities: Array) -> Array:
        """
        Return what the (k,) rows are at roller speeds [m/s].

        :param velocities: (r,) [m/s].
        """
        return np.concatenate([NO_ROWS, *(part.matrix.dot(velocities) for part in self.parts)])

    def take(self, numbers: Indices) -> Rows:
        """
        Return some rows.

        :param numbers: (j,) ascending numbers of the rows.
        """
        stops = np.cumsum([len(part.upper) for part in self.parts])
        places = numbers.searchsorted(stops).tolist()
        found: list[Array] = []
        for part, stop, first, last in zip(
            self.parts, stops.tolist(), [0, *places], places, strict=False
        ):
            found.append(part.matrix[numbers[first:last] - (stop - len(part.upper))])
        return Rows(np.concatenate(found), self.lower[numbers], self.upper[numbers])

    def admit(self, velocities: Array) -> bool:
        """
        Return whether all rows admit roller speeds.

        :param velocities: (r,) [m/s].
        """
        for matrix, lower, upper in self.parts:
            rates = matrix.dot(velocities)
            if not ((rates <= upper) & (rates >= lower)).all():
                return False
        return True


class Limit(Protocol):
    """One limit of the robot."""

    @property
    def status(self) -> Status:
        """Return the status of a command that this limit slows."""

    @property
    def can_slide(self) -> bool:
        """Return whether a command may go on along this limit, with `slide_along_limits`."""

    def rows(self, config: Configuration) -> Rows:
        """
        Return the rows of this limit.

        :param config: configuration of the robot.
        """

    def row_names(self, config: Configuration) -> tuple[str, ...]:
        """
        Return the name of the roller or member of each row.

        :param config: configuration of the robot.
        """


@functools.lru_cache(maxsize=16)
def speed_rows(count: int, max_speed: float) -> Rows:
    """
    Return the rows of `RollerSpeedLimit`, which are not to be written to.

    :param count: number of rollers.
    :param max_speed: of each [m/s].
    """
    bound = np.full(count, max_speed)
    rows = Rows(np.eye(count), -bound, bound)
    for array in rows:
        array.flags.writeable = False
    return rows


@dataclass(frozen=True)
class RollerSpeedLimit:
    """
    No roller moves its tube faster than `max_speed`.

    :ivar max_speed: positive [m/s].
    """

    max_speed: float
    status: ClassVar[Status] = Status.SLOWED_ROLLER_SPEED
    can_slide: ClassVar[bool] = False

    def rows(self, config: Configuration) -> Rows:
        """Return one row for each roller; see `Limit.rows`."""
        return speed_rows(len(config.robot.roller_names), self.max_speed)

    def row_names(self, config: Configuration) -> tuple[str, ...]:
        """Return the rollers' names; see `Limit.row_names`."""
        return config.robot.roller_names


@dataclass(frozen=True)
class MemberLengthLimit:
    """
    No member gets shorter than `min_length` or longer than `max_length`.

    A member approaches a bound at most at `rate` times its distance from it, so a loop that runs
    at `rate` [Hz] or faster never violates the bound: lengths are linear in roller travel.

    :ivar min_length: pinch to pinch [m].
    :ivar max_length: pinch to pinch [m].
    :ivar rate: of the approach to a bound [1/s].
    """

    min_length: float
    max_length: float
    rate: float = 10.0
    status: ClassVar[Status] = Status.SLOWED_MEMBER_LENGTH
    can_slide: ClassVar[bool] = True

    def rows(self, config: Configuration) -> Rows:
        """Return one row for each member; see `Limit.rows`."""
        lengths = config.member_lengths
        return Rows(
            config.robot.topology.incidence,
            np.minimum(0.0, self.rate * (self.min_length - lengths)),
            np.maximum(0.0, self.rate * (self.max_length - lengths)),
        )

    def row_names(self, config: Configuration) -> tuple[str, ...]:
        """Return the members' names; see `Limit.row_names`."""
        return config.robot.member_names


@functools.lru_cache(maxsize=16)
def default_limits(robot: Robot) -> tuple[Limit, ...]:
    """
    Return the limits of the robot file.

    :param robot: the robot.
    """
    file = robot.description
    return (
        RollerSpeedLimit(file.max_speed),
        MemberLengthLimit(file.min_length, file.max_length),
    )


def stack_rows(config: Configuration, limits: Sequence[Limit]) -> StackedRows:
    """
    Return the rows of all limits, one limit after the other.

    :param config: configuration of the robot.
    :param limits: the limits.
    """
    return StackedRows([limit.rows(config) for limit in limits])


def name_binding_rows(
    config: Configuration, limits: Sequence[Limit], rows: StackedRows, binding: Flags
) -> tuple[Status, tuple[str, ...]]:
    """
    Return the status of the first limit that binds, and the names of all rows that bind.

    :param config: configuration of the robot.
    :param limits: the limits.
    :param rows: their rows.
    :param binding: (k,) which of the rows bind.
    """
    places = np.flatnonzero(binding)
    numbers = rows.limit[places].tolist()
    names = {number: limits[number].row_names(config) for number in set(numbers)}
    first = rows.limit.searchsorted(numbers).tolist()
    status = limits[numbers[0]].status if numbers else Status.SLOWED_ROLLER_SPEED
    return status, tuple(
        names[number][place - start]
        for number, place, start in zip(numbers, places.tolist(), first, strict=True)
    )
