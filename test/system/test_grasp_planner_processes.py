# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The processes of grasp_planner: as many as asked for, and none that is left behind."""

import os
import signal
import subprocess
import sys
import time

from action_msgs.msg import GoalStatus
from isotruss_msgs.action import PlanGrasp
from lifecycle_msgs.msg import Transition
from nightly import some_now
from planning import goal, NO_MARGIN, node, workers
from probe import DEADLINE, Manager, world
import psutil
import pytest
from rclpy.action import ActionClient
from robot_processes import UNSHARED


class Client:
    """
    Asks as any action client does, while joint states come all the time.

    :param w: the world.
    """

    def __init__(self, w, positions=None):
        self.feedback = []
        self._world = w
        self._joints = {} if positions is None else {'position': list(positions)}
        self._client = ActionClient(w.probe, PlanGrasp, 'plan_grasp')
        self.until(self._client.server_is_ready)
        # The node has heard of the rollers when it says so.
        self.until(lambda: w.nodes[1].inputs.rollers is not None)

    def until(self, what):
        """Spin until something holds."""
        self._world.until(what, lambda: self._world.probe.send_joints(**self._joints), 0.02)

    def send(self, asked):
        """Send a goal and return its handle."""
        self.feedback = []
        future = self._client.send_goal_async(
            asked, lambda message: self.feedback.append((time.monotonic(), message.feedback))
        )
        self.until(future.done)
        return future.result()

    def begin(self, asked):
        """Send a goal and wait until candidates are looked at."""
        handle = self.send(asked)
        assert handle.accepted
        self.until(lambda: self.feedback and self.feedback[-1][1].evaluations > 0)
        return handle

    def result(self, handle):
        """Return how it ended: status of the action, result."""
        future = handle.get_result_async()
        self.until(future.done)
        return future.result().status, future.result().result

    def plan(self, asked):
        """Send a goal and wait for its end."""
        handle = self.send(asked)
        assert handle.accepted
        return self.result(handle)


pytestmark = pytest.mark.system

Result = PlanGrasp.Result


def test_survives_the_death_of_a_process():
    with world(node(workers=2)) as w:
        client = Client(w)
        handle = client.begin(goal(min_slip_margin=NO_MARGIN))
        client.until(lambda: len(workers()) == 2)
        before = workers()
        before[0].kill()
        status, result = client.result(handle)
        assert (status, result.code) == (GoalStatus.STATUS_ABORTED, Result.FAILED)
        assert 'a process of the search died' in result.message
        status, result = client.plan(goal(count=1))
        assert (status, result.code) == (GoalStatus.STATUS_SUCCEEDED, Result.FOUND)
        assert not set(before) & set(workers())


@pytest.mark.nightly
def test_leaves_no_process_when_it_is_deactivated_or_destroyed():
    with world(node(workers=2)) as w:
        client, manager = Client(w), Manager(w, 'grasp_planner')
        handle = client.begin(goal(min_slip_margin=NO_MARGIN))
        client.until(lambda: len(workers()) == 2)
        assert manager.ask(Transition.TRANSITION_DEACTIVATE)
        status, result = client.result(handle)
        assert (status, result.code) == (GoalStatus.STATUS_ABORTED, Result.FAILED)
        assert result.message == 'the node was deactivated'
        assert not workers()
        assert not client.send(goal()).accepted
        assert manager.ask(Transition.TRANSITION_ACTIVATE)
        client.begin(goal(min_slip_margin=NO_MARGIN))
        client.until(workers)
    assert not workers()


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
