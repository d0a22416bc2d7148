# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node `record`: what it keeps of each topic, and what becomes of a disk that is full."""

import subprocess
import sys

from isotruss_ros.nodes.conversions.messages import read_stamp
from isotruss_ros.nodes.framework.parameters import ParameterError
from isotruss_ros.nodes.record import Record
import numpy as np
from probe import overrides, ROBOT, world
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

mcap = pytest.importorskip('mcap.reader')
pytestmark = pytest.mark.system


def test_a_recording_contains_the_published_messages(tmp_path):
    from isotruss_ros.viewer.recording import read_recording

    path = tmp_path / 'stop.mcap'
    with world() as w:
        node = Record(overrides(file=str(path)))
        w.add(node)
        node.begin()
        w.until(lambda: w.probe.stops.get_subscription_count() > 0)
        w.probe.stops.publish(Bool(data=True))
        w.until(lambda: node.count > 0)
        w.until(lambda: node.count > 1, w.probe.send_joints)
        node.stop()
    with path.open('rb') as stream:
        topics = {channel.topic for _, channel, _ in mcap.make_reader(stream).iter_messages()}
    assert topics == {'/emergency_stop', '/joint_states'}
    time, _, states = next(read_recording(path))
    assert time == pytest.approx(read_stamp(states.header), abs=60.0)
    with pytest.raises(ParameterError, match='must be a new file'):
        Record.begin(node)
    assert list(states.name) == list(ROBOT.roller_names)


def test_a_full_disk_ends_the_process_with_one_line_and_what_was_written_is_played(tmp_path):
    """A limit to the size of files, 4 MB, is as a full disk."""
    from isotruss_ros.viewer.recording import BrokenRecordingError, read_recording

    path, log = tmp_path / 'full.mcap', tmp_path / 'log'
    node = f'{sys.executable} -m isotruss_ros.executables record --ros-args -p file:={path}'
    positions = np.random.default_rng(1).random(50_000)
    large = JointState(position=positions.tolist())
    with world() as w, log.open('wb') as output:
        process = subprocess.Popen(
            ['/bin/sh', '-c', f'ulimit -f 8192; exec {node}'],
            stdout=output,
            stderr=subprocess.STDOUT,
        )
        try:
            w.until(
                lambda: process.poll() is not None, lambda: w.probe.joint_states.publish(large)
            )
        finally:
            process.kill()
    assert process.returncode == 1
    started, ended = log.read_text().splitlines()
    assert started == f'record: {path}'
    assert ended.startswith(f'cannot go on: {path}: File too large')
    messages = []
    with pytest.raises(BrokenRecordingError, match='ends after'):
        messages.extend(read_recording(path))
    assert messages
    assert all(np.array_equal(message.position, positions) for _, _, message in messages)
