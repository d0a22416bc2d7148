"""The processes of grasp_planner: as many as asked for, and none that is left behind."""

import re
import signal
import subprocess
import sys

from action_msgs.msg import GoalStatus
from isotruss_msgs.action import PlanGrasp
from isotruss_ros.core import Cylinder, GraspRequirements, plan_grasps
from lifecycle_msgs.msg import Transition
import numpy as np
from planning import assert_same, CENTER, Client, DIAMETER, goal, NO_MARGIN, node, workers
from probe import check_refused, Manager, ROBOT, world
import psutil
import pytest
from rclpy.action import ActionClient

pytestmark = pytest.mark.nodes

Result = PlanGrasp.Result


def test_survives_the_death_of_a_process():
    with world(node(workers=2)) as w:
        client = Client(w)
        handle = client.begin(goal(min_margin=NO_MARGIN))
        before = workers()
        assert len(before) == 2
        before[0].kill()
        status, result = client.result(handle)
        assert (status, result.code) == (GoalStatus.STATUS_ABORTED, Result.FAILED)
        assert 'a process of the search died' in result.message
        status, result = client.plan(goal(count=1))
        assert (status, result.code) == (GoalStatus.STATUS_SUCCEEDED, Result.FOUND)
        assert not set(before) & set(workers())


def test_answers_the_same_on_one_process_from_where_the_robot_is():
    positions = [0.01, -0.02, 0.015, 0.0, -0.01, 0.02]
    with world(node(workers=1)) as w:
        client = Client(w, positions)
        status, result = client.plan(goal(count=1))
        assert status == GoalStatus.STATUS_SUCCEEDED
        assert len(workers()) == 1
        config = ROBOT.configuration(positions)
        needs = GraspRequirements(count=1)
        assert_same(result, plan_grasps(config, Cylinder(CENTER, DIAMETER), needs))
        assert np.array_equal(result.grasps[0].path.points[0].positions, positions)
    assert not workers()


def test_needs_joint_states_that_can_be_relied_on():
    with world(node()) as w:
        client = ActionClient(w.probe, PlanGrasp, 'plan_grasp')
        w.until(client.server_is_ready)

        def answer():
            sent = client.send_goal_async(goal())
            w.until(sent.done)
            got = sent.result().get_result_async()
            w.until(got.done)
            assert got.result().status == GoalStatus.STATUS_ABORTED
            assert got.result().result.code == Result.NO_JOINT_STATES
            return got.result().result.message

        assert 'joint states: none received yet' in answer()
        for send, words in (
            (lambda: w.probe.send_joints(name=['nobody'] * 6), 'rollers south/P, .* are missing'),
            (lambda: w.probe.send_joints(age=100.0), 's old; must be at most 5.0 s'),
            (lambda: w.probe.send_joints(age=-100.0), 's in the future'),
            (lambda: w.probe.send_joints(position=[5.0] * 6), 'member|length|shape|straight'),
        ):
            before = w.nodes[1]._rollers
            w.until(lambda before=before: w.nodes[1]._rollers is not before, send)
            assert re.search(words, answer())
        assert not workers()


def test_leaves_no_process_when_it_is_deactivated_or_destroyed():
    with world(node(workers=2)) as w:
        client, manager = Client(w), Manager(w, 'grasp_planner')
        handle = client.begin(goal(min_margin=NO_MARGIN))
        assert len(workers()) == 2
        assert manager.ask(Transition.TRANSITION_DEACTIVATE)
        status, result = client.result(handle)
        assert (status, result.code) == (GoalStatus.STATUS_ABORTED, Result.FAILED)
        assert result.message == 'the node was deactivated'
        assert not workers()
        assert not client.send(goal()).accepted
        assert manager.ask(Transition.TRANSITION_ACTIVATE)
        client.begin(goal(min_margin=NO_MARGIN))
        assert workers()
    assert not workers()


@pytest.mark.parametrize('how', [signal.SIGKILL, signal.SIGINT])
def test_leaves_no_process_when_its_own_is_ended(how):
    command = [sys.executable, '-m', 'isotruss_ros.nodes.grasp_planner', '--ros-args']
    command += ['-p', 'workers:=2', '-p', 'command_timeout:=5.0']
    process = subprocess.Popen(command, start_new_session=True)
    try:
        with world() as w:
            client = ActionClient(w.probe, PlanGrasp, 'plan_grasp')
            w.until(client.server_is_ready)

            def ask():
                # Again and again: what is sent while nodes discover each other may be lost.
                w.probe.send_joints()
                client.send_goal_async(goal(min_margin=NO_MARGIN))

            w.until(lambda: len(workers(process.pid)) == 2, ask, 0.5)
            children = workers(process.pid)
            process.send_signal(how)
            process.wait(20.0)
            assert not psutil.wait_procs(children, 20.0)[1]
            assert process.returncode == (-how if how == signal.SIGKILL else 0)
    finally:
        process.kill()
        process.wait()


@pytest.mark.parametrize('count', [-1, 257])
def test_refuses_a_number_of_workers_that_cannot_be(count):
    check_refused(node(workers=count), f'workers: {count}: must be from 0 .* to 256')
