# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node `record`: what it keeps of each topic, and what becomes of a disk that is full."""

import contextlib
import json
import subprocess
import sys

from isotruss_ros.nodes.record import _describe_quality, Record
import numpy as np
from probe import overrides, world
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

mcap = pytest.importorskip('mcap.reader')
pytestmark = pytest.mark.system


@contextlib.contextmanager
def recording(path):
    """Bring up a node that records what the probe publishes; it is finished at the end."""
    with world() as w:
        node = Record(overrides(file=str(path)))
        w.add(node)
        node.begin()
        yield w, node
        node.stop()


def record_stop_and_states(path):
    """Record a stop and joint states; return the channels by topic."""
    with recording(path) as (w, node):
        w.until(lambda: w.probe.stops.get_subscription_count() > 0)
        w.probe.stops.publish(Bool(data=True))
        wanted = {'emergency_stop', 'joint_states'}
        w.until(lambda: wanted <= node._channels.keys(), w.probe.send_joints)
    with path.open('rb') as stream:
        summary = mcap.make_reader(stream).get_summary()
    return {channel.topic: channel for channel in summary.channels.values()}


def test_each_channel_has_the_quality_of_its_publishers(tmp_path):
    channels = record_stop_and_states(tmp_path / 'stop.mcap')

    def offered(topic):
        return json.loads(channels[topic].metadata['offered_qos_profiles'])

    assert [profile['durability'] for profile in offered('/emergency_stop')] == ['transient_local']
    assert [profile['durability'] for profile in offered('/joint_states')] == ['volatile']
    assert offered('/joint_states')[0]['reliability'] == 'reliable'


def test_a_quality_has_the_keys_and_words_of_rosbag2():
    profile = QoSProfile(
        depth=7,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
        reliability=ReliabilityPolicy.BEST_EFFORT,
    )
    said = _describe_quality(profile)
    assert (said['history'], said['depth']) == ('keep_last', 7)
    assert (said['durability'], said['reliability']) == ('transient_local', 'best_effort')
    durations = ('deadline', 'lifespan', 'liveliness_lease_duration')
    assert all(said[name] == {'sec': 0, 'nsec': 0} for name in durations)
    assert said.keys() - durations == {
        'history',
        'depth',
        'reliability',
        'durability',
        'liveliness',
        'avoid_ros_namespace_conventions',
    }


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
                lambda: process.poll() is not None,
                lambda: w.probe.joint_states.publish(large),
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
