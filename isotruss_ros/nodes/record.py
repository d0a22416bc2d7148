# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Node `record`: writes what the view shows to an MCAP file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
import time
from typing import TYPE_CHECKING

from geometry_msgs.msg import PoseStamped, Twist, WrenchStamped
from isotruss_msgs.msg import GraspState, ManipulationStatus
from isotruss_ros.nodes.conversions.message_text import schema_text, type_name
from isotruss_ros.nodes.framework import parameters as params
from isotruss_ros.nodes.framework.qos import NEWEST
from isotruss_ros.nodes.framework.runner import run, StoppableNode
from isotruss_ros.viewer.names import MissingPackageError
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from visualization_msgs.msg import MarkerArray

if TYPE_CHECKING:
    from mcap.writer import Writer

FILE = params.Spec(
    'file', '', 'MCAP file to be written, never over another; empty: by date and time', None, True
)
TOPICS = {
    'joint_states': JointState,
    'object_pose': PoseStamped,
    'external_wrench': WrenchStamped,
    'cmd_vel': Twist,
    'roller_velocity_controller/commands': Float64MultiArray,
    'manipulation/status': ManipulationStatus,
    'grasp/state': GraspState,
    'grasp/markers': MarkerArray,
}
#: The number of a publisher's messages is not known to subscribers; the format takes zero.
NO_SEQUENCE = 0
#: A node that is stopped by a signal is woken by a timer [s].
PERIOD = 0.2


class Record(StoppableNode):
    """
    Write every message of the topics that the view shows, from the first one on.

    :param parameter_overrides: values of parameters other than the defaults.
    :raises IsotrussError: a parameter is unusable, or the file exists.
    """

    def __init__(self, parameter_overrides: Sequence[Parameter] = ()) -> None:
        super().__init__('record', parameter_overrides=list(parameter_overrides))
        self._values = params.Parameters(self, (FILE,))
        self._writer: Writer | None = None
        self._channels: dict[str, int] = {}
        self.count = 0
        for topic, kind in TOPICS.items():
            # The bytes as they were sent: rclpy would serialise a message with bytes left over.
            self.create_subscription(
                kind,
                topic,
                lambda message, name=topic: self._write(name, message),
                NEWEST,
                raw=True,
            )
        self.create_timer(PERIOD, lambda: None)

    def open_file(self) -> Path:
        """
        Create the file and return its path.

        :raises ParameterError: it exists or cannot be created.
        :raises MissingPackageError: mcap is not installed.
        """
        try:
            from mcap.writer import Writer
        except ModuleNotFoundError as error:
            raise MissingPackageError(error) from error
        name = self._values[FILE] or time.strftime('isotruss_%Y-%m-%d_%H-%M-%S.mcap')
        try:
            self._stream = Path(name).open('xb')  # noqa: SIM115 - open until `stop`
        except OSError as error:
            raise params.ParameterError(f'parameter file: {name}: {error.strerror}') from error
        self._writer = Writer(self._stream)
        self._writer.start(profile='ros2', library='isotruss_ros')
        for topic, kind in TOPICS.items():
            schema = self._writer.register_schema(
                type_name(kind), 'ros2msg', schema_text(kind).encode()
            )
            self._channels[topic] = self._writer.register_channel(
                self.resolve_topic_name(topic), 'cdr', schema
            )
        return Path(name)

    def stop(self) -> None:
        """Finish the file."""
        if self._writer is not None:
            self._writer.finish()
            self._stream.close()
            self._writer = None
            print(f'record: {self.count} messages', flush=True)

    def _write(self, topic: str, message: bytes) -> None:
        if self._writer is None:
            return
        now = self.get_clock().now().nanoseconds
        self._writer.add_message(self._channels[topic], now, message, now, NO_SEQUENCE)
        self.count += 1


def _make_node() -> Record:
    node = Record()
    print(f'record: {node.open_file()}', flush=True)
    return node


def main(args: Sequence[str] | None = None) -> int:
    """
    Record until it is interrupted.

    :param args: of the command line; those of the process if None.
    """
    return run(_make_node, args)
