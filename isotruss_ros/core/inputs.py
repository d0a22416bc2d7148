# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Inputs of a control loop: check of stamps, latest valid values, and histories.

From the history of commands, the roller travel since an old measurement is predicted.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, field
import enum
from operator import itemgetter
from typing import Any, NamedTuple

from isotruss_ros.core.errors import IsotrussError
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.records import replace
import numpy as np
from numpy.typing import ArrayLike

#: Largest time by which a stamp may be ahead of the clock [s]; clocks are not exactly synchronous.
CLOCK_SKEW = 0.01
#: Age of a message, in timeouts, from which on its sender has ended rather than is late.
ENDED_SHARE = 3.0
#: Largest age of pressures [s]; they change slowly and are measured rarely.
PRESSURE_TIMEOUT = 2.0
#: Largest admissible timeout of inputs [s]. Motions are stored for this time, so that a
#: measurement is compared with the state at its own time.
MAX_TIMEOUT = 10.0
#: Time for which the estimator of the state stores encoder readings [s], and largest age of its
#: measurements.
HISTORY_DURATION = 1.0
#: Smallest relative change of a pressure that is not regarded as noise [-]. The noise of pressure
#: sensors changes the estimated squeeze by 0.1 %.
PRESSURE_CHANGE = 0.02


class InputFault(enum.Enum):
    """Kinds of faults of an input message."""

    MISSING = 'missing'
    STALE = 'stale'
    INVALID = 'invalid'


class RejectedInput(NamedTuple):
    """Input that was received but is invalid."""

    reason: str  #: sentence that describes the fault
    fault: InputFault = InputFault.INVALID  #: INVALID or STALE


class StampedInput(NamedTuple):
    """Measured or commanded value with the time of its stamp."""

    value: Any
    time: float  #: time at which the value is valid [s]
    rejected: RejectedInput | None = None  #: last message rejected after `time`


class RollerState(NamedTuple):
    """Measured state of the rollers."""

    positions: Array  #: (r,) roller travel since home [m]
    velocities: Array  #: (r,) roller speeds [m/s]; zero for rollers without measured speed
    #: (r,) estimated roller offsets, which were added to the encoder readings [m]
    offsets: Array | float = 0.0


#: Latest value of an input; None before the first value.
Input = StampedInput | RejectedInput | None


@dataclass(eq=False, slots=True)
class LatestInputs:
    """Latest value of each input; an input is None before its first value."""

    twist: Input = None  #: commanded twist (vx, vy, omega) in the robot frame [m/s, rad/s]
    rollers: Input = None  #: measured `RollerState`
    estimate: Input = None  #: `EstimatedTravel` with the roller offsets
    pose: Input = None  #: measured `Pose` of the object in the robot frame
    markers: Input = None  #: measured joint positions {name: (x, y)} [m]
    #: gauge pressures (t,) of the tubes in the order of the robot file [Pa]; None: the pressures
    #: of the robot file are used
    pressures: Input = None
    wrench: Input = None  #: external wrench (fx, fy, m) on the object [N, N m]; None: zero
    obstacles: Input = None  #: moving obstacles, a tuple of `Obstacle` with stamps
    held_grip: Input = None  #: `GripRecord` of the control loop that holds the object
    grasp: Input = None  #: message `GraspState` of the node `grasp_analysis`
    servo_feedback: Input = None  #: `ServoFeedback` of the manipulation node
    failed: frozenset[str] = frozenset()  #: names of rollers that the client declares failed
    #: status and reason of a halt by the client; None if the client does not halt
    halt: tuple[Any, str] | None = None


class InputError(IsotrussError):
    """An input is missing, stale or invalid; `name` is that of the input."""

    def __init__(self, fault: InputFault, name: str, message: str) -> None:
        super().__init__(message)
        self.fault, self.name = fault, name


def check_stamp(
    name: str,
    stamp: float,
    now: float,
    timeout: float,
    setting: str = 'command_timeout',
    skew: float = CLOCK_SKEW,
) -> float:
    """
    Check a stamp; return it, or the current time if the stamp is slightly in the future [s].

    This rule applies to all stamps in all nodes (docs/safety.md). The error names the parameter
    `setting` that contains the timeout, if any.
    """
    words, age = name.replace('_', ' '), now - stamp
    if stamp == 0.0 and age > timeout:
        message = f'{words}: the stamp is missing (zero); must be the time of the measurement'
        raise InputError(InputFault.STALE, name, message)
    if age > timeout:
        is_late = setting and age < ENDED_SHARE * timeout
        remedy = f' ({setting}: set it higher where the machine is busy)' if is_late else ''
        message = f'{words}: {age:.3f} s old; must be at most {timeout} s{remedy}'
        raise InputError(InputFault.STALE, name, message)
    if age < -skew:
        remedy = f'must be at most {skew:g} s: synchronise the clocks'
        message = f'{words}: stamped {-age:.3f} s in the future; {remedy}'
        raise InputError(InputFault.INVALID, name, message)
    return min(stamp, now)


def require_accepted(name: str, given: Input) -> StampedInput | None:
    """Return an input, None before the first one; raise InputError for a rejected message."""
    if isinstance(given, RejectedInput):
        raise InputError(given.fault, name, given.reason)
    return given


def require_fresh(
    now: float, timeout: float, setting: str = 'command_timeout', **inputs: Input
) -> tuple[StampedInput, ...]:
    """Return the inputs, given by name; raise InputError unless all are valid and fresh [s]."""
    for name, given in inputs.items():
        accepted = require_accepted(name, given)
        if accepted is None:
            words = name.replace('_', ' ')
            raise InputError(InputFault.MISSING, name, f'{words}: none received yet')
        try:
            check_stamp(name, accepted.time, now, timeout, setting)
        except InputError:
            if accepted.rejected is None:
                raise
            raise InputError(accepted.rejected.fault, name, accepted.rejected.reason) from None
    return tuple(inputs.values())  # type: ignore[arg-type]


def has_ended(now: float, timeout: float, given: Input) -> bool:
    """Return whether the last message was valid, and is too old to be merely late. Times in s."""
    if not isinstance(given, StampedInput) or given.rejected is not None:
        return False
    return now - given.time >= ENDED_SHARE * timeout


def find_fresh(now: float, timeout: float, given: Input) -> Any:
    """Return the value of an input; None if it is missing, rejected or stale. Times are in s."""
    try:
        (fresh,) = require_fresh(now, timeout, given=given)
        return fresh.value
    except InputError:
        return None


def fresh_pressures(now: float, timeout: float, pressures: Input) -> tuple[float, ...] | None:
    """Return the measured gauge pressures (t,) of the tubes [Pa]; None before the first input."""
    if pressures is None:
        return None
    (fresh,) = require_fresh(now, timeout, 'pressure_timeout', tube_pressures=pressures)
    return fresh.value


def steady_pressures(
    kept: tuple[float, ...] | None, pressures: tuple[float, ...] | None
) -> tuple[float, ...] | None:
    """Return measured gauge pressures (t,) [Pa], or `kept` if the changes are noise only."""
    if kept is None or pressures is None:
        return pressures
    change = np.abs(np.subtract(pressures, kept))
    return kept if (change <= np.multiply(PRESSURE_CHANGE, kept)).all() else pressures


@dataclass(frozen=True, eq=False)
class Timeline:
    """
    Values at increasing times [s], between which numbers are interpolated linearly.

    :ivar samples: pairs of time and value, in order of time.
    """

    samples: tuple[tuple[float, Any], ...] = ()

    def __bool__(self) -> bool:
        """Return whether a value is stored."""
        return bool(self.samples)

    @property
    def first(self) -> tuple[float, Any]:
        """Return the earliest time and its value."""
        return self.samples[0]

    @property
    def last(self) -> tuple[float, Any]:
        """Return the latest time and its value."""
        return self.samples[-1]

    @property
    def values(self) -> list[Any]:
        """Return all values in order of time."""
        return [value for _, value in self.samples]

    def added(self, time: float, value: Any) -> Timeline:
        """Return the timeline with a value, without values added for this time or later."""
        count = len(self.samples)
        while count and self.samples[count - 1][0] >= time:
            count -= 1
        return Timeline((*self.samples[:count], (time, value)))

    def since(self, time: float) -> Timeline:
        """Return the samples that are needed to interpolate at the given time or later."""
        count = max(bisect_right(self.samples, time, key=itemgetter(0)) - 1, 0)
        return Timeline(self.samples[count:]) if count else self

    def at(self, time: float) -> Any:
        """Return the interpolated value; beyond the first and the last time, it is constant."""
        following = bisect_right(self.samples, time, key=itemgetter(0))
        if following == 0:
            return self.first[1]
        if following == len(self.samples):
            return self.last[1]
        start, start_value = self.samples[following - 1]
        end, end_value = self.samples[following]
        return start_value + (time - start) / (end - start) * (end_value - start_value)


@dataclass(frozen=True, eq=False)
class UsedReadings:
    """
    Last used reading of each sensor, which distinguishes new measurements from repeated ones.

    A new measurement has a later stamp and another value: noise differs in the last bit at least.

    :ivar last: stamp [s] and content of the last used reading by the name of the sensor.
    """

    last: Mapping[str, tuple[float, bytes]] = field(default_factory=dict)

    def use(self, name: str, time: float, value: ArrayLike) -> tuple[UsedReadings, bool]:
        """Return the readings with a reading stamped at `time` [s], and whether it is new."""
        last, content = self.last.get(name), np.asarray(value, dtype=float).tobytes()
        if last is not None:
            # A stamp that is much earlier is that of a clock that was set back.
            is_late = last[0] - HISTORY_DURATION < time <= last[0]
            if is_late or content == last[1]:
                return self, False
        return UsedReadings({**self.last, name: (time, content)}), True


@dataclass(frozen=True, eq=False)
class CommandHistory:
    """
    History of commanded roller speeds, which are piecewise constant in time.

    :ivar count: number r of rollers.
    :ivar last: (r,) speeds of the last command [m/s]; None without commands.
    :ivar previous: (r,) speeds of the command before [m/s]; None without it.
    :ivar travelled: integral (r,) of the commands up to each time, from any start [m].
    """

    count: int
    last: Array | None = None
    previous: Array | None = None
    travelled: Timeline = Timeline()

    @property
    def step(self) -> Array:
        """Return the change (r,) of the speeds by the last command [m/s]."""
        speeds = (np.zeros(self.count) if v is None else v for v in (self.last, self.previous))
        return np.subtract(*speeds)

    def recent(self, now: float, span: float) -> CommandHistory:
        """Return the commands in a span [s] that ends now; none if the clock was set back."""
        if self.last is None:
            return self
        if not 0.0 <= now - self.travelled.last[0] <= span:
            return CommandHistory(self.count)
        return replace(self, travelled=self.travelled.since(now - span))

    def elapsed(self, now: float) -> float:
        """Return the time since the last command, 0 without commands [s]."""
        return 0.0 if self.last is None else now - self.travelled.last[0]

    def recorded(self, now: float, speeds: Array) -> CommandHistory:
        """Return the history with roller speeds (r,) [m/s] commanded from the time `now` on."""
        none = np.zeros(self.count)
        travelled = self.travelled.added(
            now, none if self.last is None else self._until(now, none)
        )
        return CommandHistory(self.count, speeds, self.last, travelled)

    def travel(self, begin: float, end: float, before: Array) -> Array:
        """
        Return the motion of the rollers, (r,) [m], due to the commands between two times [s].

        `before` are the speeds (r,) before the first command of the history [m/s].
        """
        if self.last is None:
            return (end - begin) * before
        return self._until(end, before) - self._until(begin, before)

    def expected_travel(
        self, rollers: StampedInput, then: float, now: float, lead: float, stopped: Array
    ) -> tuple[Array, Array, Array]:
        """
        Predict the roller travel from a measurement to a moment slightly in the future.

        This moment is `lead` after `now`. The rollers are assumed to follow the commands, except
        `stopped` (r,). Before the first command the measured speeds are used, because another
        client may have moved the rollers. The result is the travel from the measurement to `then`
        [m] and to that moment [m], and the mean speeds from now to it [m/s].
        """
        # Rollers that are stopped have no travel.
        measured = rollers.value.velocities
        speeds = np.where(stopped, 0.0, measured if self.last is None else self.last)
        to_then = np.where(stopped, 0.0, self.travel(rollers.time, then, measured))
        to_now = np.where(stopped, 0.0, self.travel(rollers.time, now, measured))
        return to_then, to_now + lead * speeds, speeds

    def _until(self, time: float, before: Array) -> Array:
        """Return the integral (r,) of the commands [m]; before them, the speeds are `before`."""
        (first, _), (last, travel) = self.travelled.first, self.travelled.last
        if time > last:
            return travel + (time - last) * self.last
        return self.travelled.at(time) + min(time - first, 0.0) * before
