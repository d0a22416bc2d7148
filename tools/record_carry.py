# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Record a carry of the robot in MuJoCo, which a page of the site plays.

    python tools/record_carry.py docs/images/carry.mcap

Times are those of the simulation: a busy machine takes longer. At most one message of each topic
in `PERIOD` is kept.
"""

from __future__ import annotations

import contextlib
from pathlib import Path
import sys
import tempfile
from typing import Any

from isotruss_ros.core import load_robot
from isotruss_ros.demo.client import DemoClient
from isotruss_ros.demo.path import Phase, translation
from isotruss_ros.demo.processes import keep_to_this_machine, NodeProcess, running_nodes
from isotruss_ros.viewer.recording import read_recording, RecordingError
from mcap.reader import make_reader
from mcap.writer import Writer
import rclpy
from rclpy.signals import SignalHandlerOptions

#: Period of the kept messages [s]; a page of twice the speed shows ten a second.
PERIOD = 0.2
ROBOT = 'nine_member'
TIME = {'use_sim_time': True}
OBJECT = TIME | {'object_diameter': 0.3, 'friction': 0.8}
#: Inputs may be late, since processes pause on a busy machine [s].
COMMON = OBJECT | {'command_timeout': 1.5}
NODES = (
    ('simulator', COMMON | {'plant': 'mujoco', 'indentation': 0.005, 'clock_speed': 1.0}),
    ('manipulation', COMMON | {'object_mass': 0.5}),
    ('grasp_analysis', COMMON | {'rate': 5.0}),
)
#: Motions of the object, each with its duration [s] and its displacement [m].
PHASES = (
    translation('forth', 10.0, -0.1, -0.12),
    translation('back', 10.0, 0.1, 0.12),
)
#: Topics that a page displays.
TOPICS = ('joint_states', 'object_pose', 'grasp/state', 'grasp/markers', 'manipulation/status')


def carry(phases: tuple[Phase, ...], file: Path, logs: Path) -> None:
    """Carry the object along the phases, and record the messages from rest to rest."""
    client = DemoClient(load_robot(ROBOT).roller_names, sim_time=True)
    with running_nodes(NODES, logs) as processes:

        def check() -> None:
            for process in processes:
                process.require_running()
            client.require_alone()

        client.wait(client.find_no_analysis, check, 'an analysis of the grasp')
        recorder = NodeProcess('record', TIME | {'file': file}, logs / 'record.log')
        try:
            client.wait(
                lambda: _find_missing_topics(file), recorder.require_running, 'a recording'
            )
            client.wait_for_rest(check, 'a manipulation that is ready')
            for phase in phases:
                print(phase.name, flush=True)
                client.play(phase, check, lambda _done: None)
        finally:
            recorder.stop()
    client.destroy_node()


def _find_missing_topics(file: Path) -> list[str]:
    """Return a sentence for each displayed topic without a message in the written part."""
    missing = set(TOPICS)
    if file.exists():
        with contextlib.suppress(RecordingError):  # because the file is not complete yet
            for _, topic, _ in read_recording(file):
                missing.discard(topic.lstrip('/'))
                if not missing:
                    break
    return [f'{topic} has no recorded message' for topic in sorted(missing)]


def thin(file: Path, thinned: Path) -> None:
    """Write the displayed topics of a recording with at most one message in each period."""
    last: dict[str, int] = {}
    channels: dict[str, int] = {}
    with file.open('rb') as stream, thinned.open('wb') as written:
        writer = Writer(written)
        writer.start(profile='ros2', library='isotruss_ros')
        messages: Any = make_reader(stream).iter_messages()
        for schema, channel, message in messages:
            topic = channel.topic.lstrip('/')
            tick = round(1e-9 * message.log_time / PERIOD)
            if topic not in TOPICS or last.get(topic) == tick:
                continue
            last[topic] = tick
            if topic not in channels:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[topic] = writer.register_channel(
                    channel.topic, channel.message_encoding, number
                )
            writer.add_message(
                channels[topic], message.log_time, message.data, message.publish_time
            )
        writer.finish()


def main() -> None:
    """Write the recording."""
    thinned = Path(sys.argv[1])
    keep_to_this_machine()
    # Python's own: those of rclpy would close the context before the nodes are stopped.
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / 'carry.mcap'
        carry(PHASES, file, Path(folder))
        thin(file, thinned)
    rclpy.shutdown()


if __name__ == '__main__':
    main()
