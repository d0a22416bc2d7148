# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The examples of nodes, beside one set of nodes."""

from pathlib import Path
import subprocess
import sys

from isotruss_ros.demo.processes import running_nodes
import pytest

pytestmark = [pytest.mark.system, pytest.mark.xdist_group('carried')]
EXAMPLES = Path(__file__).parents[2] / 'examples'
#: What each prints, beside whatever else.
PRINTED = {
    'ros_analyze_box': 'held: True',
    'ros_grasp_state': 'held: ',
    'ros_twist': 'the object moved up by',
}
#: Reason with which each ends without nodes.
REASONS = {
    'ros_analyze_box': 'no node offers analyze_grasp in 20 s',
    'ros_grasp_state': 'nothing on grasp/state in 20 s',
    'ros_pick_and_place': 'no node offers pick_object in 20 s',
    'ros_twist': 'object pose: unknown in 20 s',
}
PATIENT = {'command_timeout': 5.0}


@pytest.fixture(scope='module')
def processes(shared_domain, tmp_path_factory):
    """Return the nodes that hold an object; they end as they should after the tests."""
    names = {'simulator': {'indentation': 0.005}, 'manipulation': {}, 'grasp_analysis': {}}
    nodes = [(name, PATIENT | values) for name, values in names.items()]
    with running_nodes(nodes, tmp_path_factory.mktemp('nodes')) as found:
        yield found
    assert [process.process.returncode for process in found] == [0, 0, 0]


@pytest.mark.parametrize('name', PRINTED)
@pytest.mark.usefixtures('processes')
def test_an_example_runs_beside_the_nodes(name):
    command = [sys.executable, EXAMPLES / f'{name}.py']
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True)
    assert PRINTED[name] in done.stdout


def test_examples_without_nodes_fail_after_20_s_with_a_reason():
    commands = {name: [sys.executable, EXAMPLES / f'{name}.py'] for name in REASONS}
    runs = {
        name: subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        for name, command in commands.items()
    }
    for name, run in runs.items():
        _, reason = run.communicate(timeout=300)
        assert run.returncode == 1, name
        assert REASONS[name] in reason
