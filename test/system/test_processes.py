# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Nodes as processes, bytes that are no message, floods over DDS, and the node 'record'."""

import os
import re
import signal
import subprocess
import sys

from action_msgs.msg import GoalStatus
from geometry_msgs.msg import Twist, TwistStamped, WrenchStamped
from isotruss_msgs.action import PlanGrasp
from isotruss_ros.core import Status
from isotruss_ros.demo.processes import NodeError, NodeProcess, running_nodes
from isotruss_ros.nodes.conversions.messages import read_stamp
from isotruss_ros.nodes.framework.parameters import ParameterError
from isotruss_ros.nodes.framework.runner import catch_signals, STOP_SIGNALS
from isotruss_ros.nodes.grasp_analysis import GraspAnalysisNode
from isotruss_ros.nodes.record import Record
from isotruss_ros.nodes.simulator.node import Simulator
from nightly import some_now
import numpy as np
from planning import goal, NO_MARGIN, node, workers
from probe import DEADLINE, manipulation, N, overrides, ROBOT, world
import psutil
import pytest
from rclpy.action import ActionClient
from robot_processes import UNSHARED
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64MultiArray

pytestmark = pytest.mark.system
#: A busy machine delays; these tests are about what happens, not how soon.
PATIENT = {'command_timeout': 5.0}
Result = PlanGrasp.Result


@pytest.fixture
def w():
    with world() as made:
        yield made


def test_manipulation_stops_cleanly_with_a_zero_command(w, tmp_path):
    with running_nodes([('simulator', PATIENT), ('manipulation', PATIENT)], tmp_path) as nodes:
        w.until(lambda: np.nan_to_num(w.command()).any(), w.probe.send_twist)
        for _ in range(2):
            os.killpg(nodes[1].process.pid, signal.SIGTERM)  # a session and group of its own
        w.until(lambda: nodes[1].process.poll() is not None)
        w.until(lambda: not w.command().any())
        assert nodes[1].process.returncode == 0
        assert 'Traceback' not in nodes[1].log.read_text()


def test_an_interruption_raises_nowhere_unless_it_comes_twice():
    """Raised in the middle of a conversion it would come out of rclpy as another error."""
    before = {which: signal.getsignal(which) for which in STOP_SIGNALS}
    try:
        received = catch_signals()
        assert not received
        signal.raise_signal(signal.SIGTERM)
        assert received
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    finally:
        for which, handler in before.items():
            signal.signal(which, handler)


def test_a_node_that_has_ended_is_reported_with_its_code_and_words(tmp_path):
    process = NodeProcess('simulator', {'robot': '/nowhere/robot.yaml'}, tmp_path / 'log')
    assert process.process.wait(DEADLINE) == 1
    with pytest.raises(NodeError, match=r'ended with code 1: .*no such file'):
        process.require_running()
    assert 'Traceback' not in process.log.read_text()


def test_a_text_with_characters_of_yaml_reaches_a_node_unchanged(tmp_path):
    path = '/nowhere/{mine}: é #1.yaml'
    process = NodeProcess('simulator', {'robot': path}, tmp_path / 'log')
    assert process.process.wait(DEADLINE) == 1
    assert f'robot {path!r}: there is no such' in process.log.read_text()


def log(home):
    """Return an environment in which the log of ROS has no folder but a home."""
    return {'HOME': home, 'ROS_LOG_DIR': '', 'ROS_HOME': ''}


LATIN = b'robot:=/tmp/w\xf6lfe.yaml'
REFUSED = [
    (
        ('simulator', '--ros-args', '--params-file', '/nowhere.yaml'),
        {},
        r'^cannot start: .*/nowhere\.yaml.*Error opening YAML file\n$',
    ),
    (('simulator',), log('/proc'), r'^cannot start: .*set ROS_LOG_DIR to a folder .*written.*\n$'),
    (('simulator',), log(''), r'^cannot start: .*HOME is not set.*ROS_LOG_DIR.*\n$'),
    (('release',), log(''), 'HOME is not set.*ROS_LOG_DIR'),
    (('demo', '--output', '.'), log(''), 'HOME is not set.*ROS_LOG_DIR'),
    (
        ('simulator', '--ros-args', '-p', LATIN),
        {},
        "^cannot start: argument 'robot:=/tmp/w.*set LC_ALL=C.UTF-8.*\n$",
    ),
    (('simulator', '--plant', 'mujoco'), {}, 'unrecognized arguments: --plant mujoco'),
]


@pytest.mark.parametrize(('words', 'environment', 'printed'), REFUSED)
def test_a_command_that_cannot_start_prints_the_reason(words, environment, printed):
    done = subprocess.run(
        [sys.executable, '-m', 'isotruss_ros.executables', *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=DEADLINE,
        check=False,
        env=os.environ | {'COLUMNS': '200'} | environment,
    )
    assert done.returncode
    assert 'Traceback' not in done.stdout
    assert re.search(printed, done.stdout), done.stdout


def test_survives_the_death_of_a_process():
    with world(node(workers=2)) as w:
        client = ActionClient(w.probe, PlanGrasp, 'plan_grasp')

        def until(what):
            w.until(what, w.probe.send_joints, 0.02)

        def begin(asked):
            sent = client.send_goal_async(asked)
            until(sent.done)
            assert sent.result().accepted
            return sent.result().get_result_async()

        def end(result):
            until(result.done)
            return result.result().status, result.result().result

        until(client.server_is_ready)
        until(lambda: w.nodes[1].inputs.rollers is not None)
        searched = begin(goal(min_slip_margin=NO_MARGIN))
        until(lambda: len(workers()) == 2)
        before = workers()
        before[0].kill()
        status, result = end(searched)
        assert (status, result.code) == (GoalStatus.STATUS_ABORTED, Result.FAILED)
        assert 'a process of the search died' in result.message
        status, result = end(begin(goal(count=1)))
        assert (status, result.code) == (GoalStatus.STATUS_SUCCEEDED, Result.FOUND)
        assert not set(before) & set(workers())


@pytest.mark.parametrize('how', some_now([signal.SIGKILL, signal.SIGINT]))
def test_leaves_no_process_when_its_own_is_ended(how):
    command = [sys.executable, '-m', 'isotruss_ros.executables', 'grasp_planner', '--ros-args']
    command += ['-p', 'workers:=2', '-p', 'command_timeout:=5.0']
    process = subprocess.Popen(command, env=os.environ | UNSHARED, start_new_session=True)
    try:
        with world() as w:
            client = ActionClient(w.probe, PlanGrasp, 'plan_grasp')
            w.until(client.server_is_ready)

            def ask():
                # Again and again: what is sent while nodes discover each other may be lost.
                w.probe.send_joints()
                client.send_goal_async(goal(min_slip_margin=NO_MARGIN))

            w.until(lambda: len(workers(process.pid)) == 2, ask, 0.5)
            children = workers(process.pid)
            process.send_signal(how)
            process.wait(DEADLINE)
            assert not psutil.wait_procs(children, DEADLINE)[1]
            assert process.returncode == (-how if how == signal.SIGKILL else 0)
    finally:
        process.kill()
        process.wait()


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
