# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Inputs of a control loop: rule for stamps, latest value of each input and its validity.

A history of commands predicts the travel since an old measurement.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
import enum
from operator import itemgetter
from typing import Any, NamedTuple

from isotruss_ros.core.errors import IsotrussError
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Largest lead of a stamp [s]; clocks are never exactly synchronous.
CLOCK_SKEW = 0.01
#: The same in simulated time [s]: inputs overtake the message on /clock that they are stamped by,
#: by up to the longest cycle of a node.
SIMULATED_CLOCK_SKEW = 0.1
#: Largest age of pressures [s]; they change slowly and are measured rarely.
PRESSURE_TIMEOUT = 2.0
#: Largest age of a measurement in a history [s].
HISTORY_DURATION = 1.0
#: Relative noise of a pressure [-]; changes the squeeze by 0.1 %.
PRESSURE_CHANGE = 0.02


class InputFault(enum.Enum):
    """Fault of an input."""

    MISSING = 'missing'
    STALE = 'stale'
    INVALID = 'invalid'


class RejectedInput(NamedTuple):
    """
    A received but invalid input.

    :ivar reason: fault in words.
    :ivar fault: INVALID or STALE.
    """

    reason: str
    fault: InputFault = InputFault.INVALID


class StampedInput(NamedTuple):
    """
    A measured or commanded value.

    :ivar value: the value.
    :ivar time: time at which it is valid [s].
    :ivar rejected: the last message rejected since then; None without one.
    """

    value: Any
    time: float
    rejected: RejectedInput | None = None


class RollerState(NamedTuple):
    """
    Measured state of the rollers.

    :ivar positions: (r,) travel since home [m].
    :ivar velocities: (r,) speeds [m/s]; zeros where not measured.
    :ivar offsets: (r,) estimated roller offsets, included in the positions [m].
    """

    positions: Array
    velocities: Array
    offsets: Array | float = 0.0


#: Latest value of an input; None before the first.
Input = StampedInput | RejectedInput | None


class InputError(IsotrussError):
    """
    An input is missing, stale or invalid.

    :ivar fault: kind of the fault.
    :ivar name: name of the input, with underscores for spaces.
    :param fault: kind of the fault.
    :param name: name of the input, with underscores for spaces.
    :param message: the reason in words.
    """

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
    Return the effective time of a stamp: at most the current time.

    This is the rule for all stamps of all nodes (docs/safety.md). The age of an input from the
    future is counted from its reception.

    :param name: name of the input, with underscores for spaces.
    :param stamp: time of the input [s].
    :param now: time on the same clock [s].
    :param timeout: largest age [s].
    :param setting: parameter of the timeout, for the error; empty without one.
    :param skew: largest lead of the stamp [s].
    :raises InputError: the stamp is too old, or in the future by more than the skew.
    """
    words, age = name.replace('_', ' '), now - stamp
    if age > timeout:
        remedy = f' ({setting}: set it higher where the machine is busy)' if setting else ''
        message = f'{words}: {age:.3f} s old; must be at most {timeout} s{remedy}'
        raise InputError(InputFault.STALE, name, message)
    if age < -skew:
        raise InputError(
            InputFault.INVALID,
            name,
            f'{words}: stamped {-age:.3f} s in the future; must be at most {skew:g} s: '
            'synchronise the clocks',
        )
    return min(stamp, now)


def keep_latest(kept: Input, received: StampedInput | RejectedInput, now: float) -> Input:
    """
    Return the valid latest of two inputs with checked stamps.

    Messages may arrive out of order: earlier ones are dropped. A rejected message does not erase a
    measurement, which is used until it times out; the reason is stored with it.

    :param kept: the previous input.
    :param received: the new input.
    :param now: time on the clock of the stamps [s]; a later `kept` is from before the clock was
        set back, and dropped.
    """
    if not isinstance(kept, StampedInput) or kept.time > now + CLOCK_SKEW:
        return received
    if isinstance(received, RejectedInput):
        return kept._replace(rejected=received)
    return kept if received.time < kept.time else received


def require_fresh(
    now: float, timeout: float, setting: str = 'command_timeout', **inputs: Input
) -> tuple[StampedInput, ...]:
    """
    Return the values of inputs that are all valid and fresh.

    :param now: time on the clock of the inputs [s].
    :param timeout: largest age [s].
    :param setting: see `check_stamp`.
    :param inputs: the inputs by name, with underscores for spaces.
    :raises InputError: an input is missing, rejected, timed out, or stamped in the future.
    """
    for name, given in inputs.items():
        if given is None:
            words = name.replace('_', ' ')
            raise InputError(InputFault.MISSING, name, f'{words}: none received yet')
        if isinstance(given, RejectedInput):
            raise InputError(given.fault, name, given.reason)
        try:
            check_stamp(name, given.time, now, timeout, setting)
        except InputError:
            if given.rejected is None:
                raise
            raise InputError(given.rejected.fault, name, given.rejected.reason) from None
    return tuple(inputs.values())  # type: ignore[arg-type]


def fresh_pressures(now: float, timeout: float, pressures: Input) -> tuple[float, ...] | None:
    """
    Return the measured gauge pressures of the tubes (t,) [Pa]; None if none was ever received.

    :param now: time on the clock of the input [s].
    :param timeout: largest age [s].
    :param pressures: input of pressures.
    :raises InputError: rejected, timed out, or stamped in the future.
    """
    if pressures is None:
        return None
    (found,) = require_fresh(now, timeout, 'pressure_timeout', tube_pressures=pressures)
    return found.value


def steady_pressures(
    kept: tuple[float, ...] | None, pressures: tuple[float, ...] | None
) -> tuple[float, ...] | None:
    """
    Return the model pressures, updated only for changes above `PRESSURE_CHANGE`.

    :param kept: (t,) previous gauge pressures by tube [Pa]; None: those of the robot file.
    :param pressures: (t,) measured pressures [Pa]; None: those of the robot file.
    """
    if kept is None or pressures is None:
        return pressures
    near = np.allclose(pressures, kept, rtol=PRESSURE_CHANGE, atol=0.0)
    return kept if near else pressures


class Timeline:
    """Piecewise linear function of time, scalar or array."""

    def __init__(self) -> None:
        self._known: deque[tuple[float, float | Array]] = deque()

    def __bool__(self) -> bool:
        """Return whether it has a value."""
        return bool(self._known)

    @property
    def first(self) -> tuple[float, float | Array]:
        """Return the first time [s] and its value."""
        return self._known[0]

    @property
    def last(self) -> tuple[float, float | Array]:
        """Return the last time [s] and its value."""
        return self._known[-1]

    @property
    def values(self) -> list[float | Array]:
        """Return all values in order of time."""
        return [value for _, value in self._known]

    def add(self, time: float, value: float | Array) -> None:
        """
        Add a value; values at that time and later are removed.

        :param time: [s].
        :param value: value at that time.
        """
        while self._known and self._known[-1][0] >= time:
            self._known.pop()
        self._known.append((time, value))

    def clear(self) -> None:
        """Drop all values."""
        self._known.clear()

    def discard_before(self, time: float) -> None:
        """
        Remove values that do not affect a given time and later.

        :param time: [s].
        """
        while len(self._known) > 1 and self._known[1][0] <= time:
            self._known.popleft()

    def at(self, time: float) -> float | Array:
        """
        Return the interpolated value at a time, constant beyond both ends.

        :param time: [s].
        """
        after = bisect_right(self._known, time, key=itemgetter(0))
        if after in (0, len(self._known)):
            return self._known[min(after, len(self._known) - 1)][1]
        (start, value), (end, following) = self._known[after - 1], self._known[after]
        return value + (time - start) / (end - start) * (following - value)


class CommandHistory:
    """
    Commanded roller speeds, piecewise constant in time.

    :ivar last: (r,) last commanded speeds [m/s]; None without entries.
    :param count: number of rollers.
    """

    def __init__(self, count: int) -> None:
        self._count = count
        self.clear()

    def clear(self) -> None:
        """Drop all entries."""
        self.last: Array | None = None
        self._travel = Timeline()  # integral of the commands up to each time, from any start [m]

    def discard_old(self, now: float, span: float) -> None:
        """
        Remove old entries; all if the clock ran back or the last one is before the span.

        :param now: time on the clock of the entries [s].
        :param span: required length of the history [s].
        """
        if self.last is not None and not 0.0 <= now - self._travel.last[0] <= span:
            self.clear()
        self._travel.discard_before(now - span)

    def elapsed(self, now: float, default: float) -> float:
        """
        Return the time since the last command [s].

        :param now: time on the clock of the entries [s].
        :param default: result without entries [s].
        """
        return default if self.last is None else now - self._travel.last[0]

    def record(self, now: float, speeds: Array) -> None:
        """
        Record a command.

        :param now: time, not before the last entry [s].
        :param speeds: (r,) [m/s].
        """
        none = np.zeros(self._count)
        self._travel.add(now, none if self.last is None else self._until(now, none))
        self.last = speeds

    def travel(self, begin: float, end: float, before: Array) -> Array:
        """
        Return the commanded roller travel between two times (r,) [m].

        :param begin: [s].
        :param end: the travel is negative where that is earlier [s].
        :param before: (r,) speeds at times before the first entry [m/s].
        """
        if self.last is None or begin == end:
            return (end - begin) * before
        return self._until(end, before) - self._until(begin, before)

    def expected_travel(
        self, rollers: StampedInput, then: float, now: float, ahead: float, still: Array
    ) -> tuple[Array, Array, Array]:
        """
        Return the predicted roller travel since their measurement.

        The rollers are assumed to follow the commands. Before the first command, measured speeds
        are used, since another client may have moved the rollers.

        :param rollers: the measured `RollerState`.
        :param then: intermediate time [s].
        :param now: time on the clock of the entries [s].
        :param ahead: prediction horizon after now [s].
        :param still: (r,) mask of the rollers that do not follow commands.
        :return: (r,) each: travel until `then`, until the end [m], and mean speeds from now to the
            end [m/s].
        """
        measured = rollers.value.velocities
        last = np.where(still, 0.0, measured if self.last is None else self.last)
        before, travel = (
            np.where(still, 0.0, self.travel(rollers.time, end, measured)) for end in (then, now)
        )
        return before, travel + ahead * last, last

    def _until(self, time: float, before: Array) -> Array:
        """Return the commanded travel until a time (r,), given the initial speeds [m]."""
        (first, _), (last, travel) = self._travel.first, self._travel.last
        if time > last:
            return travel + (time - last) * self.last
        return self._travel.at(time) + min(time - first, 0.0) * before
