# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""State of a node on `/diagnostics` and in the log, without flooding either."""

from __future__ import annotations

from collections.abc import Callable, Mapping
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from isotruss_ros.nodes.framework.cycle import create_steady_timer
from isotruss_ros.nodes.framework.topics import EVENTS

#: From one report to the next when nothing changes [s].
PERIOD = 1.0
#: Changes for the worse are reported at once, those for the better not oftener than this [s].
SHORTEST_PERIOD = 0.1


class Diagnostics:
    """
    The diagnostic status of one node; setting it between two reports costs next to nothing.

    The package `diagnostic_updater` does the same at a fixed period, and has no wheel for a
    machine without ROS.

    :ivar hardware_id: name of the robot, once it is loaded; reported behind the node's namespace,
        since robots side by side may have the same.
    :param node: a `StoppableNode`, which publishes from now until it is destroyed.
    :param details: returns values by name; called for each report.
    """

    def __init__(self, node: Any, details: Callable[[], Mapping[str, object]]) -> None:
        self.hardware_id = ''
        self._node, self._details = node, details
        self._level, self._message = DiagnosticStatus.OK, ''
        self._sent_level, self._sent = DiagnosticStatus.OK, 0.0
        self._reports = node.create_publisher(DiagnosticArray, '/diagnostics', EVENTS)
        create_steady_timer(node, PERIOD, self.report)

    def set_status(self, level: bytes, message: str) -> None:
        """
        Set the status; report it at once if the level is another one.

        :param level: constant of `DiagnosticStatus`.
        :param message: for a person to read.
        """
        self._level, self._message = level, message
        if level != self._sent_level and (
            level > self._sent_level or time.monotonic() - self._sent >= SHORTEST_PERIOD
        ):
            self.report()

    def report(self) -> None:
        """Publish the present status, and that the cycle is too slow, which is logged as well."""
        cycle, level, message = self._node.cycle, self._level, self._message
        if cycle is not None and cycle.slowness:
            level, message = max(level, DiagnosticStatus.WARN), f'{message}; {cycle.slowness}'
            self._node.warn('rate', cycle.slowness)
        self._node.log_ended()
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
