# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bytes that are no message, floods of messages over DDS, and the node 'record'."""

import subprocess
import sys

from geometry_msgs.msg import Twist, TwistStamped, WrenchStamped
from isotruss_ros.core import Status
from isotruss_ros.demo.processes import NodeProcess
from isotruss_ros.nodes.conversions.messages import read_stamp
from isotruss_ros.nodes.framework.parameters import ParameterError
from isotruss_ros.nodes.grasp_analysis import GraspAnalysisNode
from isotruss_ros.nodes.record import Record
from isotruss_ros.nodes.simulator.node import Simulator
from nightly import some_now
import numpy as np
from probe import manipulation, N, overrides, ROBOT, world
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64MultiArray

pytestmark = pytest.mark.system


@pytest.mark.parametrize('stamped', some_now([False, True]))
def test_a_publisher_of_the_other_type_of_twist_is_named(tmp_path, stamped):
    """Of another process: in one process a topic has one type."""
    other = Twist if stamped else TwistStamped
    with world(twist_type=other) as w:
        log = tmp_path / 'manipulation.log'
        node = NodeProcess('manipulation', {'use_stamped_twist': stamped}, log)
        try:
            status = w.until_code(Status.HALT_INVALID_TWIST, w.probe.send_measured)
            words = f'cmd_vel has a publisher of {other.__name__}, which is not received'
            assert words in status.message
            assert f'set use_stamped_twist to {str(not stamped).lower()}' in status.message
            w.probe.destroy_publisher(w.probe.twists)
            w.until_code(Status.HALT_NO_TWIST, w.probe.send_measured)
        finally:
            node.stop()
        assert words in log.read_text()


def test_floods_on_every_input_do_no_harm():
    """As much as this process can send, on every topic at once; the loops turn and stops count."""
    with world(manipulation(), lambda: Simulator(), lambda: GraspAnalysisNode()) as w:
        w.until_code(Status.OK, w.probe.send_twist)
        seen = w.probe.seen['status']
        cycles = len(seen)
        large = JointState(name=[str(i) for i in range(1000)], position=[0.0] * 1000)

        def flood():
            for i in range(20):
                w.probe.send_all()
                w.probe.joint_states.publish(large)
                w.probe.wrenches.publish(WrenchStamped())
                w.probe.commands.publish(Float64MultiArray(data=[0.01 * (-1) ** i] * N))
                w.probe.stops.publish(Bool(data=False))

        w.until(lambda: len(seen) > cycles + 30, flood)
        w.probe.stops.publish(Bool(data=True))
        w.until_code(Status.HALT_EMERGENCY_STOP, lambda: [w.probe.send_all() for _ in range(100)])
        commands = np.array([m.data for _, m in w.probe.seen['command']])
        assert np.abs(commands).max() <= ROBOT.description.max_speed + 1e-9
        w.until(lambda: not w.command().any())


def test_a_recording_contains_the_published_messages(tmp_path):
    mcap = pytest.importorskip('mcap.reader')
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
    pytest.importorskip('mcap')
    from isotruss_ros.viewer.recording import BrokenRecordingError, read_recording

    path, log = tmp_path / 'full.mcap', tmp_path / 'log'
    node = f'{sys.executable} -m isotruss_ros.executables record --ros-args -p file:={path}'
    positions = np.random.default_rng(1).random(50_000)
    big = JointState(position=positions.tolist())
    with world() as w, log.open('wb') as output:
        process = subprocess.Popen(
            ['/bin/sh', '-c', f'ulimit -f 8192; exec {node}'],
            stdout=output,
            stderr=subprocess.STDOUT,
        )
        try:
            w.until(lambda: process.poll() is not None, lambda: w.probe.joint_states.publish(big))
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
