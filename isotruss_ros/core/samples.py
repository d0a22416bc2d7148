"""Measured inputs of a control loop: what came, for which time it holds, whether to rely on it."""

from __future__ import annotations

import enum
from typing import Any, NamedTuple

from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.errors import ConfigurationError, IsotrussError
from isotruss_ros.core.robot import Robot
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Stamps may be this far ahead, since clocks are never quite the same [s].
CLOCK_SKEW = 0.01


class Sample(NamedTuple):
    """A measured or commanded value and the time for which it holds [s]."""

    value: Any
    time: float


class RollerState(NamedTuple):
    """Measured travel (r,) [m] and speeds (r,) [m/s] of the rollers; zeros where not measured."""

    positions: Array
    velocities: Array


class Refusal(NamedTuple):
    """What came in place of a value, and why it cannot be used."""

    reason: str


#: The latest of an input; None for none yet.
Input = Sample | Refusal | None


class Doubt(enum.Enum):
    """Why an input cannot be relied on."""

    MISSING = enum.auto()
    STALE = enum.auto()
    INVALID = enum.auto()


class InputError(IsotrussError):
    """
    An input cannot be relied on.

    :ivar doubt: in which of the ways.
    """

    def __init__(self, doubt: Doubt, message: str) -> None:
        super().__init__(message)
        self.doubt = doubt


def require_fresh(what: str, given: Input, now: float, timeout: float) -> Sample:
    """
    Return an input that can be relied on.

    :param what: the input, for the message.
    :param now: time on the clock of the samples [s].
    :param timeout: largest age; into the future it is `CLOCK_SKEW` [s].
    :raises InputError: missing, refused, too old, or stamped in the future.
    """
    if given is None:
        raise InputError(Doubt.MISSING, f'{what}: none received yet')
    if isinstance(given, Refusal):
        raise InputError(Doubt.INVALID, given.reason)
    age = now - given.time
    if age > timeout:
        raise InputError(Doubt.STALE, f'{what}: {age:.3f} s old; must be at most {timeout} s')
    if age < -CLOCK_SKEW:
        raise InputError(
            Doubt.INVALID,
            f'{what}: stamped {-age:.3f} s in the future; must be at most {CLOCK_SKEW:g} s: '
            'synchronise the clocks',
        )
    return given


def aged(given: Input, now: float) -> Input:
    """
    Return an input that ages from now on, where it is ahead by no more than `CLOCK_SKEW`.

    :param given: as it came.
    :param now: time on the clock of the samples when it is first looked at [s].
    """
    if isinstance(given, Sample) and 0.0 < given.time - now <= CLOCK_SKEW:
        return given._replace(time=now)
    return given


class ShapeTracker:
    """
    Turns measured roller travel into configurations; the last one only makes the search short.

    :param robot: the robot.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._config = robot.home

    def configuration(self, roller_positions: Array) -> Configuration:
        """
        Return the measured configuration; the very same object while nothing moves.

        :param roller_positions: (r,) travel since home [m].
        :raises ConfigurationError: there is no such configuration.
        """
        if not np.array_equal(roller_positions, self._config.roller_positions):
            try:
                self._config = self._config.moved_to(roller_positions)
            except ConfigurationError:
                self._config = self._robot.configuration(roller_positions)
        return self._config
