# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Nodes that are killed, that hang or that fail in mid-motion, as processes; and started again."""

import signal
import subprocess
import sys

from isotruss_msgs.msg import GraspState
from isotruss_ros.core import Status
from probe import DEADLINE, Manager
import pytest
from robot_processes import robot
from std_msgs.msg import Bool

pytestmark = pytest.mark.system


def test_each_node_is_killed_in_mid_motion_and_started_again(tmp_path):
    with robot(tmp_path) as r:
        w = r.w
        for name in ('simulator', 'manipulation', 'grasp_analysis'):
            r.start(name)
        r.until_moving()
        r.until(lambda: w.code('state') == GraspState.OK)

        r.signal('manipulation', signal.SIGKILL)
        r.check_at_rest()
        r.start('manipulation')
        r.until_moving()

        r.signal('simulator', signal.SIGKILL)
        r.until(
            lambda: w.code() in (Status.HALT_STALE_JOINT_STATES, Status.HALT_STALE_OBJECT_POSE)
        )
        r.until(lambda: not w.command().any())
        r.until(lambda: w.code('state') == GraspState.STALE_JOINT_STATES)
        assert not w.probe.last('state').force_closure
        # The robot is elsewhere, at home, when it is back: the motion goes on from there.
        r.start('simulator')
        r.until_moving()
        r.until(lambda: w.code('state') == GraspState.OK)

        r.signal('grasp_analysis', signal.SIGKILL)
        r.until_moving()
        w.probe.seen['state'].clear()
        r.start('grasp_analysis')
        r.until(lambda: w.code('state') == GraspState.OK)
        r.until_moving()


def test_a_suspended_node_stops_the_rollers_and_resumes(tmp_path):
    with robot(tmp_path) as r:
        for name in ('simulator', 'manipulation'):
            r.start(name)
        r.until_moving()
        r.signal('manipulation', signal.SIGSTOP)
        r.check_at_rest()
        r.signal('manipulation', signal.SIGCONT)
        r.until_moving()
        r.signal('simulator', signal.SIGSTOP)
        r.until(lambda: r.w.code() >= Status.HALT_NO_TWIST and not r.w.command().any())
        r.signal('simulator', signal.SIGCONT)
        r.until_moving()


def test_a_latched_stop_persists_when_the_node_restarts(tmp_path):
    with robot(tmp_path) as r:
        w = r.w
        r.start('simulator')
        r.start('manipulation')
        r.until_moving()
        w.probe.stops.publish(Bool(data=True))
        r.until(lambda: w.code() == Status.HALT_EMERGENCY_STOP)
        r.check_at_rest()
        r.signal('manipulation', signal.SIGKILL)
        w.probe.seen['status'].clear()
        w.probe.seen['command'].clear()
        r.start('manipulation', require_emergency_stop=True)
        r.until(lambda: len(w.probe.seen['status']) > 50)
        assert {m.code for _, m in w.probe.seen['status']} == {Status.HALT_EMERGENCY_STOP}
        assert not any(any(m.data) for _, m in w.probe.seen['command'])
        r.check_at_rest()


def test_two_manipulation_nodes_halt_until_one_of_them_ends(tmp_path):
    with robot(tmp_path) as r:
        r.start('simulator')
        r.start('manipulation')
        r.until_moving()
        r.alive['first'] = r.alive['manipulation']
        r.start('manipulation')
        heard = r.w.probe.seen['status']

        def both_halt():
            # One after the other, from two nodes that publish at the same rate.
            codes = [message.code for _, message in heard[-100:]]
            return len(codes) == 100 and {*codes} == {Status.HALT_OTHER_COMMANDS}

        r.until(both_halt)
        assert 'another node publishes on roller_velocity' in r.w.probe.last('status').message
        r.check_at_rest()
        r.signal('first', signal.SIGKILL)
        heard.clear()
        r.until_moving()
        assert not any(message.failed_rollers for _, message in heard)


#: A manipulation node with a mistake of ours in it, for once.
MISTAKEN = """
import sys
from isotruss_ros.nodes.manipulation import Manipulation
from isotruss_ros.nodes.framework.runner import run


class Mistaken(Manipulation):
    moved = 0

    def configure(self):
        super().configure()
        send = self._commands.publish

        def publish(velocities):
            send(velocities)
            moving = any(velocities)
            self.moved += moving
            if moving and self.moved == 100:
                raise ZeroDivisionError('a mistake')

        self._commands.publish = publish


sys.exit(run(Mistaken))
"""


def test_an_unexpected_error_stops_the_rollers_and_the_services_remain(tmp_path):
    script, log = tmp_path / 'mistaken.py', tmp_path / 'mistaken.txt'
    script.write_text(MISTAKEN)
    with robot(tmp_path) as r, log.open('wb') as output:
        w = r.w
        process = subprocess.Popen([sys.executable, str(script)], stdout=output, stderr=output)
        try:
            r.start('simulator')
            r.until(lambda: 'a mistake' in w.report('manipulation').message)
            r.check_at_rest()
            r.until(lambda: not w.command().any())
            manager = Manager(w, 'manipulation')
            assert manager.state() == 'unconfigured'
            assert manager.ask(0, 'configure')
            assert manager.ask(0, 'activate')
            r.until_moving()
            process.send_signal(signal.SIGINT)
            assert process.wait(DEADLINE) == 0
        finally:
            process.kill()
            process.wait()
    assert 'ZeroDivisionError' in log.read_text()


def test_processes_wait_unconfigured_and_stop_cleanly(tmp_path):
    names = ('manipulation', 'simulator', 'grasp_analysis')
    with robot(tmp_path) as r:
        for name in names:
            r.start(name, autostart=False)
        assert {Manager(r.w, name).state() for name in names} == {'unconfigured'}
