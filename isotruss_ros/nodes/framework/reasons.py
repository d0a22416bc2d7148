# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reasons in the log: each once while it holds, with the number of times when it has ended."""

from __future__ import annotations

from collections.abc import Callable
import re
import time
from typing import NamedTuple

#: A reason that is not given again for so long has ended [s].
QUIET_TIME = 2.0
#: Reasons that take turns within one kind are logged at most this often [s].
SHORTEST_PERIOD = 1.0
#: What changes in a reason that is still the same.
NUMBERS = re.compile(r'[-+]?[\d.]+(e[-+]?\d+)?')


class Reason(NamedTuple):
    """
    A reason that holds.

    :ivar text: as it was logged.
    :ivar count: how often it was given.
    :ivar logged: when [s].
    :ivar given: when last [s].
    """

    text: str
    count: int
    logged: float
    given: float


class ReasonLog:
    """
    Log reasons when they change; numbers in them do not count.

    :param log: logs a line.
    """

    def __init__(self, log: Callable[[str], object]) -> None:
        self._log = log
        self._reasons: dict[str, Reason] = {}

    def note(self, kind: str, text: str) -> None:
        """
        Log a reason, unless it holds already.

        :param kind: reasons of one kind take each other's place; others do not hide them.
        :param text: the reason.
        """
        now, known = time.monotonic(), self._reasons.get(kind)
        if known is not None and now - known.given < QUIET_TIME:
            same = NUMBERS.sub('', text) == NUMBERS.sub('', known.text)
            if same or now - known.logged < SHORTEST_PERIOD:
                self._reasons[kind] = known._replace(count=known.count + 1, given=now)
                return
        self._end(kind)
        self._log(text)
        self._reasons[kind] = Reason(text, 1, now, now)

    def end(self) -> None:
        """Log the reasons that have ended."""
        now = time.monotonic()
        for kind, reason in list(self._reasons.items()):
            if now - reason.given >= QUIET_TIME:
                self._end(kind)

    def _end(self, kind: str) -> None:
        """Log how often a reason was given that is logged no more; once needs no line."""
        reason = self._reasons.pop(kind, None)
        if reason is not None and reason.count > 1:
            self._log(f'no longer, after {reason.count} times: {reason.text}')
