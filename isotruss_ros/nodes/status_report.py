"""What the manipulation node says of every cycle, in its status, the diagnostics and the log."""

from __future__ import annotations

from isotruss_msgs.msg import ManipulationStatus
from isotruss_ros.core import Decision, Status
from isotruss_ros.nodes.diagnostics import CycleTimes, Level
from isotruss_ros.nodes.managed import ManagedNode
from isotruss_ros.nodes.messages import stamp, twist_message
from isotruss_ros.nodes.qos import RELIABLE
from isotruss_ros.nodes.report import Reporter
from rclpy.time import Time

#: Statuses that need no words: nobody asks for anything, or all is well.
SILENT = frozenset({Status.OK, Status.IDLE, Status.HALT_NO_TWIST})


class StatusReport:
    """
    Tells what was decided; made anew whenever the node is configured.

    :param node: publishes.
    :param frame: the robot's.
    """

    def __init__(self, node: ManagedNode, frame: str) -> None:
        self._publisher = node.create_lifecycle_publisher(
            ManipulationStatus, 'manipulation/status', RELIABLE
        )
        self._frame = frame
        self._diagnostics = node.diagnostics
        self._reporter = Reporter(node.get_logger())
        self._cycle_times = CycleTimes()
        # Made once: a message with its parts costs more to make than to fill in.
        self._message = ManipulationStatus()
        self._failed: tuple[str, ...] = ()

    def tell(self, decision: Decision, now: Time) -> None:
        """Publish a decision; log it where it is not as asked."""
        command, message = decision.command, self._message
        stamp(message.header, now, self._frame)
        message.code = int(command.status)
        message.message = decision.message
        twist_message(decision.twist, message.commanded)
        twist_message(command.achieved_twist, message.achieved)
        message.scale = command.scale
        message.mobility = command.mobility
        if decision.failed != self._failed:
            self._failed = decision.failed
            message.failed_rollers = list(decision.failed)
        self._publisher.publish(message)
        level = level_of(command.status)
        words = decision.message or command.status.name
        if decision.failed:
            level = max(level, Level.WARN)
            words = f'failed rollers: {", ".join(decision.failed)}; {words}'
        self._diagnostics.say(level, words)
        if level is not Level.OK:
            self._reporter.warn(command.status.name, f'{command.status}: {words}')

    def note_cycle_time(self, duration: float) -> None:
        """Take the duration of the cycle, for the status of the next and the diagnostics [s]."""
        self._message.cycle_time = duration
        self._cycle_times.note(duration)

    def summary(self, period: float) -> dict[str, object]:
        """
        Return status and cycle times, for the diagnostics.

        :param period: from cycle to cycle [s].
        """
        last = Status(self._message.code)
        cycles = self._cycle_times.summary(period)
        return {'status': last.name, 'status code': int(last)} | cycles


def level_of(status: Status) -> Level:
    """Return how bad a status is; that nobody asks for anything is as it should be."""
    if status in SILENT:
        return Level.OK
    return Level.WARN if status < Status.HALT_NO_TWIST else Level.ERROR
