# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Publication of a node's status on `/diagnostics`, and log of warnings without repetitions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
import math
import re
import time
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from isotruss_ros.nodes.framework.topics import EVENTS

#: Time without a repetition after which the reason for a stop or warning has ended [s].
QUIET_TIME = 2.0
#: Shortest time between log entries if two reasons of one kind alternate [s].
MIN_LOG_PERIOD = 1.0
#: Numbers in a text, which are ignored when two texts are compared.
NUMBERS = re.compile(r'[-+]?[\d.]+(e[-+]?\d+)?')
#: Period of reports while the status does not change [s].
REPORT_PERIOD = 1.0
#: Shortest time between reports of an improvement [s]; a deterioration is reported at once.
MIN_REPORT_PERIOD = 0.1


class Reason(NamedTuple):
    """Reason for a stop or a warning that was logged once, with the number of its occurrences."""

    text: str  #: logged text, or that of the occurrence with the smallest `value`
    value: float  #: smallest value of the occurrences, such as a rate
    #: number of occurrences so far
    count: int  # type: ignore[assignment]
    logged: float  #: time of the log entry [s]
    latest: float  #: time of the last occurrence [s]


class ReasonLog:
    """
    Log of the reasons for a node's stops and warnings, without repetitions.

    Two texts of one kind that differ only in numbers are the same reason, which is logged once.
    """

    def __init__(self, log: Callable[[str], object]) -> None:
        self._log = log
        self._reasons: dict[str, Reason] = {}

    def note(self, kind: str, text: str, value: float = math.inf) -> None:
        """
        Log the reason for a stop or a warning; only count it if it is a repetition.

        :param value: value in the text; the end is logged with the text of the smallest value.
        """
        now, known = time.monotonic(), self._reasons.get(kind)
        if known is not None and now - known.latest < QUIET_TIME:
            same = NUMBERS.sub('', text) == NUMBERS.sub('', known.text)
            if same or now - known.logged < MIN_LOG_PERIOD:
                if same and value < known.value:
                    known = known._replace(text=text, value=value)
                self._reasons[kind] = known._replace(count=known.count + 1, latest=now)
                return
        self._end(kind)
        self._log(text)
        self._reasons[kind] = Reason(text, value, 1, now, now)

    def end(self, quiet_time: float = QUIET_TIME) -> None:
        """Log the number of occurrences of each reason that has not occurred for a time [s]."""
        now = time.monotonic()
        for kind, reason in list(self._reasons.items()):
            if now - reason.latest >= quiet_time:
                self._end(kind)

    def _end(self, kind: str) -> None:
        """Remove the reason of a kind; if it was repeated, log the number of occurrences."""
        reason = self._reasons.pop(kind, None)
        if reason is not None and reason.count > 1:
            self._log(f'no longer, after {reason.count} times: {reason.text}')


class Diagnostics:
    """
    Diagnostic status of one node, which is published at a limited rate however often it is set.

    The package `diagnostic_updater` is not used, because it has a fixed period, and cannot be
    installed from PyPI on machines without ROS.

    :ivar hardware_id: name of the robot after it is loaded. It is reported with the node's
        namespace, because several robots may have the same name.
    """

    def __init__(self, node: Any, details: Callable[[], Mapping[str, object]]) -> None:
        self.hardware_id = ''
        self._node, self._details = node, details
        self._level, self._message = DiagnosticStatus.OK, ''
        self._sent_level, self._sent = DiagnosticStatus.OK, 0.0
        self._reports = node.create_publisher(DiagnosticArray, '/diagnostics', EVENTS)
        node.create_steady_timer(REPORT_PERIOD, self.report)

    def set_status(self, message: str, level: bytes = DiagnosticStatus.OK) -> None:
        """Set the status; if the level has changed, publish it at once."""
        self._level, self._message = level, message
        if level != self._sent_level and (
            level > self._sent_level or time.monotonic() - self._sent >= MIN_REPORT_PERIOD
        ):
            self.report()

    def report(self) -> None:
        """Publish the current status; log a warning for a slow cycle."""
        cycle, level, message = self._node.cycle, self._level, self._message
        if cycle is not None and cycle.slowness:
            level, message = max(level, DiagnosticStatus.WARN), f'{message}; {cycle.slowness}'
            self._node.reasons.note('rate', cycle.slowness, cycle.rate)
        self._node.reasons.end()
        status = DiagnosticStatus(
            level=level,
            name=self._node.get_fully_qualified_name().lstrip('/'),
            message=message,
            hardware_id=f'{self._node.get_namespace()}/{self.hardware_id}'.strip('/'),
            values=[KeyValue(key=key, value=str(v)) for key, v in self._details().items()],
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = self._node.get_clock().now().to_msg()
        self._reports.publish(array)
        self._sent_level, self._sent = self._level, time.monotonic()
