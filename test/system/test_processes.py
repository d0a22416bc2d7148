# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The executables and the processes of grasp_planner, commanded over DDS only."""

import os
import re
import signal
import subprocess
import sys

from action_msgs.msg import GoalStatus
from isotruss_msgs.action import PlanGrasp
from isotruss_ros.demo.processes import NodeError, NodeProcess, running_nodes
from isotruss_ros.nodes.framework.runner import catch_signals, STOP_SIGNALS
from nightly import some_now
import numpy as np
from planning import goal, NO_MARGIN, node, workers
from probe import DEADLINE, world
import psutil
import pytest
from rclpy.action import ActionClient
from robot_processes import UNSHARED

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
