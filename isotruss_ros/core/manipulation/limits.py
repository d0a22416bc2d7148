# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Limits on the roller speeds phidot: rows lower <= G phidot <= upper of the quadratic program.

Zero speed fulfils every limit. A robot beyond a bound may stop or move back, but not move further
beyond it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import functools
from typing import ClassVar, NamedTuple, Protocol

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.numerics.arrays import Array, identity
import numpy as np

#: Largest decay rate of the distance of a member length from its bound [1/s]; control loops run at
#: this frequency or faster.
APPROACH_RATE = 10.0


class Rows(NamedTuple):
    """Limits as rows lower <= matrix @ phidot <= upper, with lower <= 0 <= upper."""

    matrix: Array  #: (k, r) coefficients of the roller speeds [-]
    lower: Array  #: (k,) lower bounds of the rows [m/s]
    upper: Array  #: (k,) upper bounds of the rows [m/s]

    def slack(self, speeds: Array) -> Array:
        """Return the distances (k,) of speeds (r,) to the nearer bounds, negative beyond [m/s]."""
        rates = self.matrix.dot(speeds)
        return np.minimum(self.upper - rates, rates - self.lower)

    def about(self, speeds: Array) -> Rows:
        """Return the limits on changes from given roller speeds (r,) [m/s]."""
        rates = self.matrix.dot(speeds)
        return Rows(self.matrix, self.lower - rates, self.upper - rates)

    def one_sided(self) -> tuple[Array, Array]:
        """Return the matrix (2k, r) and bounds (2k,) of the limits as upper bounds only [m/s]."""
        matrix = np.concatenate([self.matrix, -self.matrix])
        return matrix, np.concatenate([self.upper, -self.lower])


class Limit(Protocol):
    """Protocol of a limit on the roller speeds."""

    @property
    def status(self) -> Status:
        """Return the status code of a command that this limit reduces."""

    @property
    def can_slide(self) -> bool:
        """Return whether commands can slide along this limit, see `LimitHandling`."""

    def rows(self, config: Configuration) -> Rows:
        """
        Return the inequality rows that this limit adds to the quadratic program.

        :param config: configuration of the robot.
        """

    def row_names(self, config: Configuration) -> tuple[str, ...]:
        """
        Return the name of the roller or member of each row.

        :param config: configuration of the robot.
        """


@dataclass(frozen=True)
class RollerSpeedLimit:
    """Upper bound of the magnitudes of the roller speeds."""

    max_speed: float  #: largest roller speed, positive [m/s]
    status: ClassVar[Status] = Status.SLOWED_ROLLER_SPEED
    can_slide: ClassVar[bool] = False

    def rows(self, config: Configuration) -> Rows:
        """Return one row for each roller; see `Limit.rows`."""
        bound = np.array(len(config.robot.roller_names) * [self.max_speed])
        return Rows(identity(len(bound)), -bound, bound)

    def row_names(self, config: Configuration) -> tuple[str, ...]:
        """Return the rollers' names; see `Limit.row_names`."""
        return config.robot.roller_names


@dataclass(frozen=True)
class MemberLengthLimit:
    """
    Bounds on the member lengths, which members approach exponentially.

    The speed toward a bound is at most `rate` times the distance from the bound. Lengths are
    linear in roller travel, so a control loop at the frequency `rate` [Hz] or faster never
    violates the bound. The deceleration is at most `rate` times the largest roller speed.
    """

    min_length: float  #: smallest length, pinch point to pinch point [m]
    max_length: float  #: largest length, pinch point to pinch point [m]
    rate: float = APPROACH_RATE  #: decay rate of the distance from a bound [1/s]
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
    """Return the limits that the robot file contains."""
    file = robot.description
    rate = min(APPROACH_RATE, file.braking_rate)
    lengths = MemberLengthLimit(file.min_length, file.max_length, rate)
    return RollerSpeedLimit(file.max_speed), lengths


def stack_rows(config: Configuration, limits: Sequence[Limit]) -> Rows:
    """Return the stacked rows of several limits, in their order."""
    if not limits:
        return Rows(np.zeros((0, len(config.roller_positions))), np.zeros(0), np.zeros(0))
    parts = [limit.rows(config) for limit in limits]
    return Rows(*map(np.concatenate, zip(*parts, strict=True)))
