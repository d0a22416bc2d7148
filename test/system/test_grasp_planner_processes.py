# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The processes of grasp_planner: as many as asked for, and none that is left behind."""

import os
import signal
import subprocess
import sys

from action_msgs.msg import GoalStatus
from isotruss_msgs.action import PlanGrasp
from nightly import some_now
from planning import goal, NO_MARGIN, node, workers
from probe import DEADLINE, world
import psutil
import pytest
from rclpy.action import ActionClient
from robot_processes import UNSHARED

pytestmark = pytest.mark.system

Result = PlanGrasp.Result


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
