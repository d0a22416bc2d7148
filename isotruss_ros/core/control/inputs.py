# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Inputs of a control loop: the rule for stamps, the latest value of each, whether it can be used.

And the commands that were sent since: with them the travel since an old measurement is predicted.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from operator import itemgetter
from typing import Any, NamedTuple

from isotruss_ros.core.errors import IsotrussError
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Stamps may be this far ahead, since clocks are never exactly synchronous [s].
CLOCK_SKEW = 0.01
#: Pressures change slowly, and are measured now and then [s].
PRESSURE_TIMEOUT = 2.0
#: Share of a pressure that is taken for noise, and changes the squeeze by 0.1 %.
PRESSURE_CHANGE = 0.02


class RejectedInput(NamedTuple):
    """
    An input that was received and cannot be used.

    :ivar reason: what is wrong with it.
    :ivar fault: INVALID, or STALE for one that is too old; see `InputError`.
    """

    reason: str
    fault: str = 'INVALID'


class StampedInput(NamedTuple):
    """
    A measured or commanded value.

    :ivar value: the value.
    :ivar time: time for which it holds [s].
    :ivar rejected: the last message since then that was rejected; None without one.
    """

    value: Any
    time: float
    rejected: RejectedInput | None = None


class RollerState(NamedTuple):
    """
    Measured state of the rollers.

    :ivar positions: (r,) travel since home [m].
    :ivar velocities: (r,) speeds [m/s]; zeros where not measured.
    :ivar offsets: (r,) what an estimate added to the readings of the encoders for the positions
        [m].
    """

    positions: Array
    velocities: Array
    offsets: Array | float = 0.0


#: The latest of an input; None before the first.
Input = StampedInput | RejectedInput | None


class InputError(IsotrussError):
    """
    An input cannot be used.

    :ivar fault: NO, STALE or INVALID.
    :ivar name: name of the input.
    :ivar code: both, such as NO_TWIST, STALE_TWIST or INVALID_TWIST; the codes of statuses and
        reports have these names.
    :param fault: NO, STALE or INVALID.
    :param name: name of the input.
    :param message: the reason in words.
    """

    def __init__(self, fault: str, name: str, message: str) -> None:
        super().__init__(message)
        self.fault, self.name, self.code = fault, name, f'{fault}_{name.upper()}'


def check_stamp(
    name: str, stamp: float, now: float, timeout: float, setting: str = 'command_timeout'
) -> float:
    """
    Return the time that counts for a stamp: the stamp, or now where it is ahead by the skew.

    This is the rule for all stamps of all nodes (docs/safety.md). The age of an input from ahead
    counts from when it is received.

    :param name: of the input, with underscores for spaces.
    :param stamp: time of the input [s].
    :param now: time on the same clock [s].
    :param timeout: largest age [s].
    :param setting: name of the timeout, for the error; empty where no parameter sets it.
    :raises InputError: the stamp is too old, or in the future by more than `CLOCK_SKEW`.
    """
    words, age = name.replace('_', ' '), now - stamp
    if age > timeout:
        remedy = f' ({setting}: set it higher where the machine is busy)' if setting else ''
        raise InputError(
            'STALE', name, f'{words}: {age:.3f} s old; must be at most {timeout} s{remedy}'
        )
    if age < -CLOCK_SKEW:
        raise InputError(
            'INVALID',
            name,
            f'{words}: stamped {-age:.3f} s in the future; must be at most {CLOCK_SKEW:g} s: '
            'synchronise the clocks',
        )
    return min(stamp, now)


def keep_latest(kept: Input, received: StampedInput | RejectedInput, now: float) -> Input:
    """
    Return the input to keep when another one is received, whose stamp was checked.

    Messages overtake each other in transport: an earlier one does not count. A rejected one never
    erases a measurement, whose age decides; the reason is kept with it.

    :param kept: the input so far.
    :param received: the other one.
    :param now: time on the clock of the stamps [s]: what is kept from after it was stamped before
        the clock was set back.
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
    Return inputs that can be used.

    :param now: time on the clock of the inputs [s].
    :param timeout: largest age [s].
    :param setting: see `check_stamp`.
    :param inputs: the inputs by name, with underscores for spaces.
    :raises InputError: the first of them that is missing, rejected, timed out, or stamped in the
        future.
    """
    for name, given in inputs.items():
        if given is None:
            words = name.replace('_', ' ')
            raise InputError('NO', name, f'{words}: none received yet')
        if isinstance(given, RejectedInput):
            raise InputError(given.fault, name, given.reason)
        try:
            check_stamp(name, given.time, now, timeout, setting)
        except InputError:
            if given.rejected is None:
                raise
            raise InputError(given.rejected.fault, name, given.rejected.reason) from None
    return tuple(inputs.values())


def fresh_pressures(now: float, timeout: float, pressures: Input) -> tuple[float, ...] | None:
    """
    Return the measured gauge pressures of the tubes (t,) [Pa]; None where none ever came.

    :param now: time on the clock of the input [s].
    :param timeout: largest age [s].
    :param pressures: input of them.
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
    Return the pressures to model tubes with: changes of less than 2 % are none, but noise.

    :param kept: (t,) modelled so far, gauge, by tube [Pa]; None for those of the robot file.
    :param pressures: (t,) measured; None for those of the file.
    """
    if kept is None or pressures is None:
        return pressures
    near = np.allclose(pressures, kept, rtol=PRESSURE_CHANGE, atol=0.0)
    return kept if near else pressures


class Timeline:
    """A quantity, a number or an array, that changes evenly from each known time to the next."""

    def __init__(self) -> None:
        self._known: deque[tuple[float, float | Array]] = deque()

    def __bool__(self) -> bool:
        """Return whether a value is known."""
        return bool(self._known)

    @property
    def first(self) -> tuple[float, float | Array]:
        """Return the first time that is kept [s] and the value then."""
        return self._known[0]

    @property
    def last(self) -> tuple[float, float | Array]:
        """Return the last time [s] and the value then."""
        return self._known[-1]

    @property
    def values(self) -> list[float | Array]:
        """Return the values that are kept, in order."""
        return [value for _, value in self._known]

    def add(self, time: float, value: float | Array) -> None:
        """
        Add a value, which takes the place of those at that time and later.

        :param time: [s].
        :param value: then.
        """
        while self._known and self._known[-1][0] >= time:
            self._known.pop()
        self._known.append((time, value))

    def clear(self) -> None:
        """Drop all values."""
        self._known.clear()

    def discard_before(self, time: float) -> None:
        """
        Drop what tells nothing of a time and later.

        :param time: [s].
        """
        while len(self._known) > 1 and self._known[1][0] <= time:
            self._known.popleft()

    def at(self, time: float) -> float | Array:
        """
        Return the value at a time; before the first it is the first, and after the last the last.

        :param time: [s].
        """
        after = bisect_right(self._known, time, key=itemgetter(0))
        if after in (0, len(self._known)):
            return self._known[min(after, len(self._known) - 1)][1]
        (start, value), (end, following) = self._known[after - 1], self._known[after]
        return value + (time - start) / (end - start) * (following - value)


class CommandHistory:
    """
    Commanded roller speeds, each from its time until the next.

    :ivar last: (r,) speeds that were commanded last [m/s]; None where nothing is recorded.
    :param count: number of rollers.
    """

    def __init__(self, count: int) -> None:
        self._count = count
        self.clear()

    def clear(self) -> None:
        """Drop all entries."""
        self.last: Array | None = None
        self._travel = Timeline()  # commanded until each time, from any start [m]

    def discard_old(self, now: float, span: float) -> None:
        """
        Drop old entries; all where the clock ran back, or the last one is older than the span.

        :param now: time on the clock of the entries [s].
        :param span: how far back entries are needed [s].
        """
        if self.last is not None and not 0.0 <= now - self._travel.last[0] <= span:
            self.clear()
        self._travel.discard_before(now - span)

    def elapsed(self, now: float, default: float) -> float:
        """
        Return the time since the last command [s].

        :param now: time on the clock of the entries [s].
        :param default: where nothing is recorded [s].
        """
        return default if self.last is None else now - self._travel.last[0]

    def record(self, now: float, speeds: Array) -> None:
        """
        Record a command.

        :param now: not before that of the last entry [s].
        :param speeds: (r,) [m/s].
        """
        none = np.zeros(self._count)
        self._travel.add(now, none if self.last is None else self._until(now, none))
        self.last = speeds

    def travel(self, begin: float, end: float, before: Array) -> Array:
        """
        Return the roller travel that was commanded between two times (r,) [m].

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
        Return how far the rollers travel after their measurement.

        They follow the commands. Measured speeds count for the time before the first one, when
        another client may have moved them.

        :param rollers: the measured `RollerState`.
        :param then: a time in between [s].
        :param now: time on the clock of the entries [s].
        :param ahead: for so long after now [s].
        :param still: (r,) whether each roller does not follow commands.
        :return: (r,) each: travel until then, until the end [m], and the speeds with which they
            get from now to there [m/s].
        """
        measured = rollers.value.velocities
        last = np.where(still, 0.0, measured if self.last is None else self.last)
        before, travel = (
            np.where(still, 0.0, self.travel(rollers.time, end, measured)) for end in (then, now)
        )
        return before, travel + ahead * last, last

    def _until(self, time: float, before: Array) -> Array:
        """Return the travel until a time (r,), where the speeds before the first are known [m]."""
        (first, _), (last, travel) = self._travel.first, self._travel.last
        if time > last:
            return travel + (time - last) * self.last
        return self._travel.at(time) + min(time - first, 0.0) * before
