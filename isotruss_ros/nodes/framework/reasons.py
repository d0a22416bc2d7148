# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Log of reasons: each is logged once while it persists, and its count at its end."""

from __future__ import annotations

from collections.abc import Callable
import re
import time
from typing import NamedTuple

#: Time without repetition after which a reason has ended [s].
QUIET_TIME = 2.0
#: Shortest time between log entries of alternating reasons of one kind [s].
MIN_LOG_PERIOD = 1.0
#: Numbers in a reason, which comparisons ignore.
NUMBERS = re.compile(r'[-+]?[\d.]+(e[-+]?\d+)?')


class Reason(NamedTuple):
    """Reason that persists."""

    text: str  #: logged text
    #: number of occurrences
    count: int  # type: ignore[assignment]
    logged: float  #: time of the log entry [s]
    given: float  #: time of the last occurrence [s]


class ReasonLog:
    """
    Log of changes of reasons; different numbers in a reason are not a change.

    :param log: function that logs a line.
    """

    def __init__(self, log: Callable[[str], object]) -> None:
        self._log = log
        self._reasons: dict[str, Reason] = {}

    def note(self, kind: str, text: str) -> None:
        """
        Log a reason, unless it already persists.

        :param kind: kind of the reason; a reason replaces only the previous one of its kind.
        :param text: reason in words.
        """
        now, known = time.monotonic(), self._reasons.get(kind)
        if known is not None and now - known.given < QUIET_TIME:
            same = NUMBERS.sub('', text) == NUMBERS.sub('', known.text)
            if same or now - known.logged < MIN_LOG_PERIOD:
                self._reasons[kind] = known._replace(count=known.count + 1, given=now)
                return
        self._end(kind)
        self._log(text)
        self._reasons[kind] = Reason(text, 1, now, now)

    def end(self) -> None:
        """Log the counts of reasons that have ended."""
        now = time.monotonic()
        for kind, reason in list(self._reasons.items()):
            if now - reason.given >= QUIET_TIME:
                self._end(kind)

    def _end(self, kind: str) -> None:
        """Log the count of a reason that has ended, if it was repeated."""
        reason = self._reasons.pop(kind, None)
        if reason is not None and reason.count > 1:
            self._log(f'no longer, after {reason.count} times: {reason.text}')
