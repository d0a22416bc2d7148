# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Demonstration, view and examples as processes: interrupted, commanded, beside nodes."""

import contextlib
from functools import partial
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from isotruss_ros.demo.domains import lock_domain
from isotruss_ros.demo.processes import NodeProcess, running_nodes
from nightly import some_now
from planning import workers
from probe import DEADLINE, world
import psutil
import pytest

pytestmark = [pytest.mark.system, pytest.mark.xdist_group('demo')]
ROOT = Path(__file__).parents[2]
#: What each prints, beside whatever else.
PRINTED = {'ros_analyze_box': 'held: True', 'ros_grasp_state': 'held: ', 'ros_twist': 'moved up'}
#: Arguments of processes, and the reason with which each ends without nodes.
REASONS = {
    'examples/ros_analyze_box.py': 'no node offers analyze_grasp in 20 s',
    'examples/ros_grasp_state.py': 'nothing on grasp/state in 20 s',
    'examples/ros_pick_and_place.py': 'no node offers pick_object in 20 s',
    'examples/ros_twist.py': 'object pose: unknown in 20 s',
    '-m isotruss_ros.executables stop --namespace right': (
        'NOT CONFIRMED: no node offers the service /right/emergency_stop in 10 s'
    ),
}
PATIENT = {'command_timeout': 5.0}


@pytest.fixture(scope='module')
def lonely():
    """Return processes in a domain without nodes, which wait for them while other tests run."""
    with contextlib.closing(lock_domain(int(os.environ['ROS_DOMAIN_ID']))) as lock:
        environment = os.environ | {'ROS_DOMAIN_ID': str(lock.number)}
        yield {
            words: subprocess.Popen(
                [sys.executable, *words.split()],
                cwd=ROOT,
                env=environment,
                stderr=subprocess.PIPE,
                text=True,
            )
            for words in REASONS
        }


def begin(folder, *options):
    """Start the demonstration; return its process."""
    return subprocess.Popen(
        [sys.executable, '-u', '-m', 'isotruss_ros.demo', '--output', str(folder), *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        # As in a terminal: what runs in the background of a script ignores it.
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
    )


def nodes_of(folder):
    """Return the processes of nodes that still write into the logs of a demonstration."""
    found = []
    for process in psutil.process_iter():
        with contextlib.suppress(psutil.Error, OSError):
            if str(folder) in os.readlink(f'/proc/{process.pid}/fd/1'):
                found.append(process.cmdline())
    return found


@pytest.mark.parametrize(
    ('sensors', 'stage', 'times'),
    some_now(
        [('real', 'search', 2), ('real', 'found: ', 2), ('perfect', '', 2), ('perfect', '', 1)]
    ),
    ids=['searching', 'planned', 'twice at its start', 'at its start'],
)
@pytest.mark.usefixtures('lonely')
def test_ctrl_c_ends_it_and_its_nodes_without_a_traceback(tmp_path, sensors, stage, times):
    """With real sensors it searches a grasp; nightly checks find it, and carry the object."""
    demo = begin(tmp_path, '--sensors', sensors)
    assert any('nodes simulator' in line for line in demo.stdout)
    log, end = tmp_path / 'grasp_planner.log', time.monotonic() + DEADLINE
    # The logs of the nodes exist before the nodes.
    while not (
        workers(demo.pid) if stage == 'search' else log.exists() and stage in log.read_text()
    ):
        assert demo.poll() is None, demo.stdout.read()
        assert time.monotonic() < end, log.read_text()
        time.sleep(0.01)
    for _ in range(times):
        os.killpg(demo.pid, signal.SIGINT)
    printed, _ = demo.communicate(timeout=3.0 * DEADLINE)
    # Where a signal interrupts code that is compiled, Python itself reports it as well.
    assert demo.returncode in (130, -signal.SIGINT), printed
    assert 'demo stopped' in printed
    assert 'Traceback' not in printed
    assert not nodes_of(tmp_path)


def test_beside_another_simulation_it_says_so(tmp_path):
    simulator = NodeProcess('simulator', {}, tmp_path / 'other.log')
    try:
        with world() as w:
            w.until(lambda: w.probe.last('joints') is not None)
        demo = begin(tmp_path)
        printed, _ = demo.communicate(timeout=2.0 * DEADLINE)
    finally:
        simulator.stop()
    assert demo.returncode == 1
    assert 'another robot or simulation is there' in ' '.join(printed.split())


@pytest.fixture(scope='module')
def processes(shared_domain, tmp_path_factory):
    """Return the nodes that hold an object; they end as they should after the tests."""
    values = {'simulator': {'indentation': 0.005}, 'grasp_analysis': {'rate': 5.0}}
    names = ('simulator', 'manipulation', 'grasp_analysis')
    nodes = [(name, PATIENT | {'rate': 50.0} | values.get(name, {})) for name in names]
    with running_nodes(nodes, tmp_path_factory.mktemp('nodes')) as found:
        yield found
    assert [process.process.returncode for process in found] == [0, 0, 0]


@pytest.mark.parametrize('name', PRINTED)
@pytest.mark.usefixtures('processes')
def test_an_example_runs_beside_the_nodes(name):
    command = [sys.executable, ROOT / 'examples' / f'{name}.py']
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True)
    assert PRINTED[name] in done.stdout


def test_examples_and_a_stop_without_nodes_fail_after_20_s_with_a_reason(lonely):
    for words, process in lonely.items():
        _, reason = process.communicate(timeout=300)
        assert process.returncode == 1, words
        assert REASONS[words] in reason
