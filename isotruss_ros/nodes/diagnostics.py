"""What a node says of itself on `/diagnostics`: every second, and when the level changes."""

from __future__ import annotations

import bisect
from collections import deque
from collections.abc import Callable, Mapping
import enum
import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from isotruss_ros.nodes.qos import DIAGNOSTICS
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node

#: From one report to the next when nothing changes [s].
PERIOD = 1.0
#: Changes for the worse are told at once, those for the better not oftener than this [s].
SHORTEST_PERIOD = 0.1


class Level(enum.IntEnum):
    """How bad it is."""

    OK = ord(DiagnosticStatus.OK)
    WARN = ord(DiagnosticStatus.WARN)
    ERROR = ord(DiagnosticStatus.ERROR)


class CycleTimes:
    """How long the cycles since the last report took; noting one costs next to nothing."""

    def __init__(self) -> None:
        # Bounded, should reports fail to come.
        self._times: deque[float] = deque(maxlen=10_000)

    def note(self, duration: float) -> None:
        """Take the duration of a cycle [s]."""
        self._times.append(duration)

    def summary(self, period: float) -> dict[str, object]:
        """
        Return what there is to know, and begin anew.

        :param period: from cycle to cycle [s]; those that took longer are overruns.
        """
        times = sorted(self._times)
        self._times.clear()
        if not times:
            return {'cycles': 0}
        return {
            'cycles': len(times),
            'cycle time, median [s]': round(times[len(times) // 2], 6),
            'cycle time, longest [s]': round(times[-1], 6),
            'overruns': len(times) - bisect.bisect_right(times, period),
        }


class Diagnostics:
    """
    The state of one node; what is said between two reports costs next to nothing.

    :ivar hardware_id: the robot, once it is known.
    :param node: publishes, from now until it is destroyed.
    :param details: gives what there is to know, by name; called for each report.
    """

    def __init__(self, node: Node, details: Callable[[], Mapping[str, object]]) -> None:
        self.hardware_id = ''
        self._node = node
        self._details = details
        self._level, self._message = Level.OK, ''
        self._sent_level, self._sent = Level.OK, 0.0
        self._reports = node.create_publisher(DiagnosticArray, '/diagnostics', DIAGNOSTICS)
        # By the steady clock: where simulated time stands still, people want to know even more.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(PERIOD, self.report, clock=steady)

    def say(self, level: Level, message: str) -> None:
        """Take note of how the node is; report it at once if the level is another one."""
        self._level, self._message = level, message
        if level is not self._sent_level and (
            level > self._sent_level or time.monotonic() - self._sent >= SHORTEST_PERIOD
        ):
            self.report()

    def report(self) -> None:
        """Publish the present state."""
        name = self._node.get_fully_qualified_name().lstrip('/')
        status = DiagnosticStatus(
            level=bytes([self._level]),
            name=name,
            message=self._message,
            hardware_id=self.hardware_id,
            values=[KeyValue(key=key, value=str(v)) for key, v in self._details().items()],
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = self._node.get_clock().now().to_msg()
        self._reports.publish(array)
        self._sent_level, self._sent = self._level, time.monotonic()
