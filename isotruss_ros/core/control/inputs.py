# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Inputs of a control loop: the latest value of each, its time, and whether it can be used.

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


class StampedInput(NamedTuple):
    """
    A measured or commanded value.

    :ivar value: the value.
    :ivar time: time for which it holds [s].
    """

    value: Any
    time: float


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


class RejectedInput(NamedTuple):
    """
    An input that was received and cannot be used.

    :ivar reason: what is wrong with it.
    """

    reason: str


#: The latest of an input; None before the first.
Input = StampedInput | RejectedInput | None


class InputError(IsotrussError):
    """
    An input cannot be used.

    :ivar name: name of the input.
    :ivar code: what is wrong with which input, such as NO_TWIST, STALE_TWIST or INVALID_TWIST; the
        codes of statuses and reports have these names.
    :param fault: NO, STALE or INVALID.
    :param name: name of the input.
    :param message: the reason in words.
    """

    def __init__(self, fault: str, name: str, message: str) -> None:
        super().__init__(message)
        self.name, self.code = name, f'{fault}_{name.upper()}'


def require_fresh(
    now: float, timeout: float, setting: str = 'command_timeout', **inputs: Input
) -> tuple[StampedInput, ...]:
    """
    Return inputs that can be used.

    :param now: time on the clock of the inputs [s].
    :param timeout: largest age [s].
    :param setting: name of the timeout, for the error.
    :param inputs: the inputs by name, with underscores for spaces.
    :raises InputError: the first of them that is missing, rejected, timed out, or stamped in the
        future.
    """
    for name, given in inputs.items():
        words = name.replace('_', ' ')
        if given is None:
            raise InputError('NO', name, f'{words}: none received yet')
        if isinstance(given, RejectedInput):
            raise InputError('INVALID', name, given.reason)
        age = now - given.time
        if age > timeout:
            raise InputError(
                'STALE',
                name,
                f'{words}: {age:.3f} s old; must be at most {timeout} s ({setting}: set it '
                'higher where the machine is busy)',
            )
        if age < -CLOCK_SKEW:
            raise InputError(
                'INVALID',
                name,
                f'{words}: stamped {-age:.3f} s in the future; must be at most {CLOCK_SKEW:g} s: '
                'synchronise the clocks',
            )
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


def limit_stamps(now: float, *inputs: Input) -> tuple[Input, ...]:
    """
    Return inputs, those stamped ahead by no more than the skew with the present time instead.

    An input that is kept so ages from its first use on.

    :param now: time on the clock of the inputs [s].
    :param inputs: as received.
    """
    return tuple(
        given._replace(time=now)
        if isinstance(given, StampedInput) and 0.0 < given.time - now <= CLOCK_SKEW
        else given
        for given in inputs
    )


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
