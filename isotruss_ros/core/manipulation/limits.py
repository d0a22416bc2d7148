# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Limits on the roller speeds: each hands the quadratic program rows lower <= G phidot <= upper.

Zero speed fulfils every limit: a robot beyond a bound may stay there or return, not go further.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import functools
from typing import ClassVar, NamedTuple, Protocol

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices
import numpy as np

#: Members approach a bound of their length at this share of their distance from it [1/s].
APPROACH_RATE = 10.0


class Rows(NamedTuple):
    """Rows lower <= matrix @ phidot <= upper, with lower <= 0 <= upper."""

    matrix: Array  #: (k, r) on the roller speeds [-]
    lower: Array  #: (k,) [m/s]
    upper: Array  #: (k,) [m/s]

    def slack(self, speeds: Array) -> Array:
        """
        Return how far the (k,) rows are from their bounds, negative beyond them [m/s].

        :param speeds: (r,) of the rollers [m/s].
        """
        rates = self.matrix.dot(speeds)
        return np.minimum(self.upper - rates, rates - self.lower)

    def take(self, chosen: Indices | Flags) -> Rows:
        """
        Return some rows.

        :param chosen: numbers of the rows, or (k,) which of them.
        """
        return Rows(self.matrix[chosen], self.lower[chosen], self.upper[chosen])


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
def _speed_rows(count: int, max_speed: float) -> Rows:
    """Return the rows of `RollerSpeedLimit`, which are not to be written to."""
    bound = np.full(count, max_speed)
    return Rows(np.eye(count), -bound, bound)


@dataclass(frozen=True)
class RollerSpeedLimit:
    """No roller moves its tube faster than `max_speed`."""

    max_speed: float  #: positive [m/s]
    status: ClassVar[Status] = Status.SLOWED_ROLLER_SPEED
    can_slide: ClassVar[bool] = False

    def rows(self, config: Configuration) -> Rows:
        """Return one row for each roller; see `Limit.rows`."""
        return _speed_rows(len(config.robot.roller_names), self.max_speed)

    def row_names(self, config: Configuration) -> tuple[str, ...]:
        """Return the rollers' names; see `Limit.row_names`."""
        return config.robot.roller_names


@dataclass(frozen=True)
class MemberLengthLimit:
    """
    No member gets shorter than `min_length` or longer than `max_length`.

    A member approaches a bound at most at `rate` times its distance from it, so a loop that runs
    at `rate` [Hz] or faster never violates the bound: lengths are linear in roller travel. Rollers
    that slow down so need `rate` times their largest speed as acceleration.
    """

    min_length: float  #: pinch to pinch [m]
    max_length: float  #: pinch to pinch [m]
    rate: float = APPROACH_RATE  #: of the approach to a bound [1/s]
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
        MemberLengthLimit(file.min_length, file.max_length, min(APPROACH_RATE, file.braking_rate)),
    )


def stack_rows(config: Configuration, limits: Sequence[Limit]) -> Rows:
    """
    Return the rows of several limits, one limit after the other.

    :param config: configuration of the robot.
    :param limits: the limits, perhaps none.
    """
    if not limits:
        return Rows(np.zeros((0, len(config.roller_positions))), np.zeros(0), np.zeros(0))
    parts = [limit.rows(config) for limit in limits]
    return Rows(*map(np.concatenate, zip(*parts, strict=True)))


def name_binding_rows(
    config: Configuration, limits: Sequence[Limit], binding: Flags
) -> tuple[Status, tuple[str, ...]]:
    """
    Return the status of the first limit that binds, and the names of all rows that bind.

    :param config: configuration of the robot.
    :param limits: the limits.
    :param binding: (k,) which of the rows bind.
    """
    rows = [(limit.status, name) for limit in limits for name in limit.row_names(config)]
    bound = [rows[place] for place in np.flatnonzero(binding)]
    status = bound[0][0] if bound else Status.SLOWED_ROLLER_SPEED
    return status, tuple(name for _, name in bound)
