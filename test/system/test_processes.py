# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The executables as processes of their own, heard and driven over DDS only."""

import os
from pathlib import Path
import signal
import subprocess
import sys
import time

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


@pytest.mark.parametrize('which', some_now(STOP_SIGNALS))
def test_a_signal_during_the_start_ends_it_without_a_word(which, tmp_path):
    process = NodeProcess('manipulation', {}, tmp_path / 'log')
    # The handlers are there before anything is imported that takes time.
    deadline = time.monotonic() + DEADLINE
    while not _has_handler(process):
        assert time.monotonic() < deadline
        process.require_running()
    process.process.send_signal(which)
    process.process.send_signal(which)
    assert process.process.wait(DEADLINE) == 0
    assert not process.log.read_text()


def _has_handler(process):
    """Tell whether a process has set its handlers: SIGHUP's is the last (see proc(5), SigCgt)."""
    status = Path(f'/proc/{process.process.pid}/status').read_text()
    caught = int(
        next(line for line in status.splitlines() if line.startswith('SigCgt')).split()[1], 16
    )
    return bool(caught >> (signal.SIGHUP - 1) & 1)


def test_bad_parameters_end_the_process_with_one_sentence(tmp_path):
    process = NodeProcess('simulator', {'robot': '/nowhere/robot.yaml'}, tmp_path / 'log')
    assert process.process.wait(DEADLINE) == 1
    printed = process.log.read_text()
    assert 'no such file' in printed
    assert 'Traceback' not in printed
    with pytest.raises(NodeError, match='ended with code 1'):
        process.require_running()


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
    command = [sys.executable, '-m', 'isotruss_ros.executables', 'simulator']
    done = subprocess.run(
        [*command, '--ros-args', '--params-file', str(path)],
        capture_output=True,
        text=True,
        timeout=DEADLINE,
        check=False,
    )
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith('cannot start: ')
    assert str(path) in line
    assert words in line


def start_simulator(*arguments, **environment):
    """Run an executable that cannot start, in an environment; return what it prints as errors."""
    done = subprocess.run(
        [sys.executable, '-m', 'isotruss_ros.executables', 'simulator', *arguments],
        capture_output=True,
        text=True,
        timeout=DEADLINE,
        check=False,
        env=os.environ | environment,
    )
    assert done.returncode
    assert 'Traceback' not in done.stderr
    return done.stderr


def test_a_home_that_cannot_be_written_is_answered_by_the_variable_to_set():
    (line,) = start_simulator(HOME='/proc', ROS_LOG_DIR='', ROS_HOME='').splitlines()
    assert line.startswith('cannot start: ')
    assert 'set ROS_LOG_DIR to a folder that can be written' in line


def test_a_home_that_is_not_set_is_named_with_the_variable_to_set():
    (line,) = start_simulator(HOME='', ROS_LOG_DIR='', ROS_HOME='').splitlines()
    assert line.startswith('cannot start: HOME is not set')
    assert 'ROS_LOG_DIR' in line


@pytest.mark.parametrize('module', ['isotruss_ros.cli.operate', 'isotruss_ros.demo'])
def test_commands_name_a_home_that_is_not_set(module, tmp_path):
    given = {
        'isotruss_ros.cli.operate': ['release'],
        'isotruss_ros.demo': ['--output', str(tmp_path)],
    }
    done = subprocess.run(
        [sys.executable, '-m', module, *given[module]],
        capture_output=True,
        text=True,
        timeout=DEADLINE,
        check=False,
        env=os.environ | {'HOME': '', 'ROS_LOG_DIR': '', 'ROS_HOME': '', 'COLUMNS': '200'},
    )
    assert done.returncode == 1
    printed = done.stdout + done.stderr
    assert 'HOME is not set' in printed
    assert 'ROS_LOG_DIR' in printed
    assert 'Traceback' not in printed


@pytest.mark.parametrize(
    'environment', some_now([{'LC_ALL': 'C', 'PYTHONUTF8': '0', 'PYTHONCOERCECLOCALE': '0'}, {}])
)
def test_a_path_in_another_encoding_is_refused_in_one_line(environment):
    path = b'robot:=/tmp/w\xf6lfe.yaml' if not environment else 'robot:=/tmp/wölfe.yaml'.encode()
    (line,) = start_simulator('--ros-args', '-p', path, **environment).splitlines()
    assert line.startswith("cannot start: argument 'robot:=/tmp/w")
    assert 'set LC_ALL=C.UTF-8' in line


def test_an_argument_that_ros_does_not_take_is_refused():
    assert 'unrecognized arguments: --plant mujoco' in start_simulator('--plant', 'mujoco')
