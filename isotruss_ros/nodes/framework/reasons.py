# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Log of reasons for a stop or a warning; repetitions are counted instead of logged."""

from __future__ import annotations

from collections.abc import Callable
import re
import time
from typing import NamedTuple

#: Time without a repetition after which a reason counts as ended [s].
QUIET_TIME = 2.0
#: Shortest time between log entries if two reasons of one kind alternate [s].
MIN_LOG_PERIOD = 1.0
#: Numbers in the text of a reason, which are ignored when two reasons are compared.
NUMBERS = re.compile(r'[-+]?[\d.]+(e[-+]?\d+)?')


class Reason(NamedTuple):
    """Reason for a stop or a warning that was logged once and whose repetitions are counted."""

    text: str  #: logged text
    #: number of occurrences so far
    count: int  # type: ignore[assignment]
    logged: float  #: time of the log entry [s]
    given: float  #: time of the last occurrence [s]


class ReasonLog:
    """
    Log of changes of reasons; reasons that differ only in numbers count as one reason.

    :param log: function that logs a line.
    """

    def __init__(self, log: Callable[[str], object]) -> None:
        self._log = log
        self._reasons: dict[str, Reason] = {}

    def note(self, kind: str, text: str) -> None:
        """
        Log a reason, or only count it if it is a repetition.

        :param kind: kind of the reason; a new reason replaces only the previous reason of the same
            kind.
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
        """For each reason that no longer occurs, log how often it occurred."""
        now = time.monotonic()
        for kind, reason in list(self._reasons.items()):
            if now - reason.given >= QUIET_TIME:
                self._end(kind)

    def _end(self, kind: str) -> None:
        """Remove the reason of a kind; if the reason was repeated, log how often it occurred."""
        reason = self._reasons.pop(kind, None)
        if reason is not None and reason.count > 1:
            self._log(f'no longer, after {reason.count} times: {reason.text}')
