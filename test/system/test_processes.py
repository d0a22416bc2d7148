# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The executables as processes of their own, heard and driven over DDS only."""

import os
import signal
import subprocess
import sys

from isotruss_ros.demo.processes import NodeError, NodeProcess, running_nodes
from isotruss_ros.nodes.framework.runner import catch_signals, STOP_SIGNALS
from nightly import some_now
import numpy as np
from probe import DEADLINE, world
import pytest

pytestmark = pytest.mark.system

#: A busy machine delays; these tests are about what happens, not how soon.
PATIENT = {'command_timeout': 5.0}


@pytest.fixture
def w():
    """Return a world of processes only."""
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


def refuse(*words, **environment):
    """Run a command that cannot start, in an environment; return what it prints."""
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
    return done.stdout


@pytest.mark.parametrize(
    ('content', 'words'),
    some_now(
        [
            (None, 'Error opening YAML file'),
            ('simulator: {rate: 3.0}', 'Cannot have a value before ros__parameters at line 1'),
        ]
    ),
)
def test_a_bad_file_of_parameters_ends_the_process_with_one_line(content, words, tmp_path):
    path = tmp_path / 'parameters.yaml'
    if content is not None:
        path.write_text(content)
    (line,) = refuse('simulator', '--ros-args', '--params-file', str(path)).splitlines()
    assert line.startswith('cannot start: ')
    assert str(path) in line
    assert words in line


@pytest.mark.parametrize(
    ('home', 'words'),
    [
        ('/proc', 'set ROS_LOG_DIR to a folder that can be written'),
        ('', 'HOME is not set'),
    ],
)
def test_a_home_without_a_log_is_answered_by_the_variable_to_set(home, words):
    (line,) = refuse('simulator', HOME=home, ROS_LOG_DIR='', ROS_HOME='').splitlines()
    assert line.startswith('cannot start: ')
    assert words in line
    assert 'ROS_LOG_DIR' in line


@pytest.mark.parametrize('words', [('release',), ('demo', '--output', '.')], ids=' '.join)
def test_commands_name_a_home_that_is_not_set(words):
    printed = refuse(*words, HOME='', ROS_LOG_DIR='', ROS_HOME='')
    assert 'HOME is not set' in printed
    assert 'ROS_LOG_DIR' in printed


@pytest.mark.parametrize(
    'environment', some_now([{'LC_ALL': 'C', 'PYTHONUTF8': '0', 'PYTHONCOERCECLOCALE': '0'}, {}])
)
def test_a_path_in_another_encoding_is_refused_in_one_line(environment):
    path = b'robot:=/tmp/w\xf6lfe.yaml' if not environment else 'robot:=/tmp/wölfe.yaml'.encode()
    (line,) = refuse('simulator', '--ros-args', '-p', path, **environment).splitlines()
    assert line.startswith("cannot start: argument 'robot:=/tmp/w")
    assert 'set LC_ALL=C.UTF-8' in line


def test_an_argument_that_ros_does_not_take_is_refused():
    assert 'unrecognized arguments: --plant mujoco' in refuse('simulator', '--plant', 'mujoco')
