"""
What the rollers may do: each limit hands the program its rows, lower <= G phidot <= upper.

Standing still fulfils every limit: who is beyond a bound may stay or leave, not go further.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.status import Status
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Rows(NamedTuple):
    """Rows lower <= matrix @ phidot <= upper: (k, r) and (k,) [m/s], with lower <= 0 <= upper."""

    matrix: Array
    lower: Array
    upper: Array


class Limit(Protocol):
    """One limit of the robot."""

    @property
    def status(self) -> Status:
        """Return the status of a command that this limit slows."""

    def rows(self, config: Configuration) -> Rows:
        """Return the rows of this limit in one configuration."""

    def row_names(self, config: Configuration) -> tuple[str, ...]:
        """Return what each row speaks of: rollers or members."""


@dataclass(frozen=True)
class RollerSpeedLimit:
    """
    No roller moves its tube quicker than `max_speed` [m/s].

    :ivar max_speed: positive [m/s].
    """

    max_speed: float

    @property
    def status(self) -> Status:
        """Return the status of a command that this limit slows."""
        return Status.SLOWED_ROLLER_SPEED

    def rows(self, config: Configuration) -> Rows:
        """Return one row for each roller."""
        count = len(config.robot.roller_names)
        bound = np.full(count, self.max_speed)
        return Rows(np.eye(count), -bound, bound)

    def row_names(self, config: Configuration) -> tuple[str, ...]:
        """Return the rollers' names."""
        return config.robot.roller_names


@dataclass(frozen=True)
class MemberLengthLimit:
    """
    No member gets shorter than `min_length` or longer than `max_length` [m].

    A member comes to a bound at most at `rate` times its distance from it, so a loop that runs
    at `rate` [Hz] or quicker never crosses: lengths are linear in roller travel.

    :ivar min_length: pinch to pinch [m].
    :ivar max_length: pinch to pinch [m].
    :ivar rate: [1/s].
    """

    min_length: float
    max_length: float
    rate: float = 10.0

    @property
    def status(self) -> Status:
        """Return the status of a command that this limit slows."""
        return Status.SLOWED_MEMBER_LENGTH

    def rows(self, config: Configuration) -> Rows:
        """Return one row for each member."""
        lengths = config.member_lengths
        return Rows(
            config.robot.layout.incidence,
            np.minimum(0.0, self.rate * (self.min_length - lengths)),
            np.maximum(0.0, self.rate * (self.max_length - lengths)),
        )

    def row_names(self, config: Configuration) -> tuple[str, ...]:
        """Return the members' names."""
        return config.robot.member_names
