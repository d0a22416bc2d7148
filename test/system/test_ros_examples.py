# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""An object carried along an arc, and the examples of nodes, beside one set of nodes."""

from pathlib import Path
import subprocess
import sys

from isotruss_msgs.msg import GraspState
from isotruss_ros.core import ConvexObject, load_robot, settle_grasp, Status
from isotruss_ros.demo.client import DemoClient
from isotruss_ros.demo.path import arc
from isotruss_ros.demo.processes import running_nodes
from isotruss_ros.nodes.conversions.messages import read_stamp
import numpy as np
from probe import begin_context
import pytest
import rclpy

pytestmark = [pytest.mark.system, pytest.mark.xdist_group('carried')]

EXAMPLES = Path(__file__).parents[2] / 'examples'
#: What each prints, beside whatever else.
PRINTED = {
    'ros_analyze_box': 'held: True',
    'ros_grasp_state': 'held: ',
    'ros_twist': 'the object moved up by',
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


@pytest.fixture
def client(processes):
    """Return a client of the nodes, and what checks that they run, once an analysis has come."""

    def check():
        for process in processes:
            process.require_running()

    begin_context()
    client = DemoClient(load_robot('nine_member').roller_names)
    client.wait(client.find_no_analysis, check, 'an analysis')
    yield client, check
    client.destroy_node()
    rclpy.shutdown()


def test_processes_carry_the_object_along_an_arc(client):
    client, check = client
    client.wait_for_rest(check, 'a manipulation that is ready')
    radius, heading, angle = 0.05, 0.5, -0.4
    phase = arc('arc', 2.0, radius, heading, angle)
    # While the machine starts other processes, a whole phase may pass without a cycle.
    for _ in range(10):
        record = client.play(phase, check, lambda done: None)
        if record.accepted.any():
            break
    # A twist that the machine delivers late is reached with limited acceleration.
    assert record.statuses <= {Status.OK, Status.IDLE, Status.ACCELERATING}
    # A process that the machine keeps waiting holds its last command for so long.
    held = 4.0 * max(record.longest_cycle, np.diff([s.time for s in record.snapshots]).max())
    assert record.position_error < 1e-3 + held * radius * abs(angle) / phase.duration
    assert record.angle_error < np.deg2rad(0.1) + held * abs(angle) / phase.duration
    assert 0.0 < record.max_roller_speed <= 0.1
    # An analysis of the rest, however late it comes.
    at_rest = record.snapshots[-1].time

    def find_old_analysis():
        stamp = read_stamp(client.last_grasp().header)
        return [] if stamp >= at_rest else [f'the last analysis is of {stamp} s']

    client.wait(find_old_analysis, check, 'an analysis at rest')
    assert_grasps_belong_to_the_motion(record)


def assert_grasps_belong_to_the_motion(record):
    """Check that the analysis ran all along, and that its last result is that of the rest."""
    assert {grasp.code for grasp in record.grasps} == {GraspState.OK}
    assert len({grasp.computing_time for grasp in record.grasps}) > 1
    rest, last = record.snapshots[-1], record.grasps[-1]
    robot = load_robot('nine_member')
    expected = settle_grasp(
        robot.configuration(rest.rollers), ConvexObject.disc(rest.pose[:2], 0.3)
    )
    pressing = sum(expected.normal_forces.values())
    assert pressing > 1.0
    forces = [contact.normal_force for contact in last.contacts]
    assert sum(forces) == pytest.approx(pressing, rel=1e-5)
    assert last.contact_members == list(expected.contact_lengths)


def test_all_examples_are_run():
    # One needs more nodes than the others: test_pick_and_place.
    found = {path.stem for path in EXAMPLES.glob('ros_*.py')}
    assert found == {*PRINTED, 'ros_pick_and_place'}


@pytest.mark.parametrize('name', PRINTED)
def test_an_example_runs_beside_the_nodes(client, name):
    command = [sys.executable, EXAMPLES / f'{name}.py']
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True)
    assert PRINTED[name] in done.stdout
