# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Node `record`, which writes shown topics and the cycles of control into an MCAP file."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
from pathlib import Path
import time
from typing import TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, Twist, WrenchStamped
from isotruss_msgs.msg import GraspState, ManipulationStatus, Obstacles
from isotruss_ros.core import IsotrussError
from isotruss_ros.extras import MissingPackageError
from isotruss_ros.nodes.conversions.message_text import schema_text, type_name
from isotruss_ros.nodes.framework.parameters import FixedSpec, ParameterError
from isotruss_ros.nodes.framework.runner import StoppableNode
from isotruss_ros.nodes.framework.topics import EVENTS, NEWEST_MESSAGES, RECORDS
from isotruss_ros.nodes.framework.transforms import TFMessage
from nav_msgs.msg import Path as PathMessage
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64MultiArray, String
from visualization_msgs.msg import MarkerArray

if TYPE_CHECKING:
    from mcap.writer import Writer

SPECS = (FixedSpec('file', '', 'New MCAP file; empty: a file named by date and time'),)
TOPICS = {
    'joint_states': JointState,
    'object_pose': PoseStamped,
    'external_wrench': WrenchStamped,
    'cmd_vel': Twist,
    'emergency_stop': Bool,
    'roller_velocity_controller/commands': Float64MultiArray,
    'manipulation/cycle': String,
    'obstacles': Obstacles,
    'planned_path': PathMessage,
    'manipulation/status': ManipulationStatus,
    'grasp/state': GraspState,
    'grasp/markers': MarkerArray,
    '/diagnostics': DiagnosticArray,
} | ({} if TFMessage is None else {'/tf': TFMessage})
#: Profiles of topics of which every message is recorded.
PROFILES = {'emergency_stop': EVENTS, 'manipulation/cycle': RECORDS}
#: Sequence number written for all messages, because subscribers do not receive the number.
UNKNOWN_SEQUENCE_NUMBER = 0
#: Period of writing to the file [s]; messages of one period may be lost if the recorder is killed.
WRITING_PERIOD = 0.5


class RecordError(IsotrussError, OSError):
    """Error: a recording cannot be written."""


class Record(StoppableNode):
    """Node that records every message of the topics that the viewer shows."""

    node_name = 'record'
    specs = SPECS

    def start(self) -> None:
        """Create the subscriptions; nothing is written before `begin` opens the file."""
        self._writer: Writer | None = None
        self._channels: dict[str, int] = {}
        self.count = 0
        for topic, kind in TOPICS.items():
            # Raw bytes: rclpy would serialise a message with trailing bytes.
            self.create_subscription(
                kind,
                topic,
                lambda message, name=topic: self._write(name, message),
                PROFILES.get(topic, NEWEST_MESSAGES),
                raw=True,
            )
        self.create_steady_timer(WRITING_PERIOD, self._flush)

    def begin(self) -> None:
        """Create the file of the recording, and print its path."""
        try:
            from mcap.writer import Writer
        except ModuleNotFoundError as error:
            raise MissingPackageError(error) from error
        name = self.values.file or time.strftime('isotruss_%Y-%m-%d_%H-%M-%S.mcap')
        try:
            self._stream = Path(name).open('xb')  # noqa: SIM115 - open until `stop`
        except OSError as error:
            raise ParameterError(
                f'parameter file: {name}: {error.strerror}; must be a new file that can be written'
            ) from error
        self._writer = Writer(self._stream)
        self._writer.start(profile='ros2', library='isotruss_ros')
        print(f'record: {name}', flush=True)

    def stop(self) -> None:
        """Complete and close the file of the recording."""
        if self._writer is not None:
            with self._writing():
                self._writer.finish()
                self._stream.close()
            self._writer = None
            print(f'record: {self.count} messages', flush=True)

    def _write(self, topic: str, message: bytes) -> None:
        if self._writer is None:
            return
        now = self.get_clock().now().nanoseconds
        with self._writing():
            if topic not in self._channels:
                self._channels[topic] = self._register(topic)
            self._writer.add_message(
                self._channels[topic], now, message, now, UNKNOWN_SEQUENCE_NUMBER
            )
        self.count += 1

    def _register(self, topic: str) -> int:
        """Add a channel for a topic."""
        kind = TOPICS[topic]
        schema = self._writer.register_schema(
            type_name(kind), 'ros2msg', schema_text(kind).encode()
        )
        return self._writer.register_channel(self.resolve_topic_name(topic), 'cdr', schema)

    def _flush(self) -> None:
        if self._writer is not None:
            with self._writing():
                self._writer.flush()

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        """Close the file if writing inside the `with` block fails because the disk is full."""
        try:
            yield
        except OSError as error:
            self._writer = None
            # Closing retries the last write.
            with contextlib.suppress(OSError):
                self._stream.close()
            raise RecordError(
                f'{self._stream.name}: {error.strerror}: `replay` shows the written part'
            ) from error
