"""Nodes that are killed, that hang or that fail in mid-motion, as processes; and started again."""

import contextlib
import signal
import subprocess
import sys
import time

from isotruss_msgs.msg import GraspState
from isotruss_ros.core import Status
from isotruss_ros.demo.processes import NodeProcess
import numpy as np
from probe import DEADLINE, Manager, ROBOT, world
from std_msgs.msg import Bool

TIMEOUT = 0.5
#: A busy machine delays [s].
SLACK = 1.5
MAX_SPEED = ROBOT.description.max_speed


class Robot:
    """
    The nodes as processes, and a probe that commands a twist.

    :param logs: folder for what they print.
    """

    def __init__(self, w, logs):
        self.w, self._logs = w, logs
        self._alive = {}
        self._started = 0

    def start(self, name, **values):
        """Start a node."""
        self._started += 1
        log = self._logs / f'{self._started}-{name}.log'
        self._alive[name] = NodeProcess(name, {'command_timeout': TIMEOUT} | values, log)

    def signal(self, name, which):
        """Send a signal to a node; after SIGKILL wait until it is gone."""
        process = self._alive[name].process
        process.send_signal(which)
        if which == signal.SIGKILL:
            process.wait(DEADLINE)
            del self._alive[name]

    def close(self):
        """Stop all, and check that none of them has failed."""
        for process in self._alive.values():
            process.process.send_signal(signal.SIGCONT)
            process.stop()
        for log in self._logs.glob('*.log'):
            assert 'Traceback' not in log.read_text(), log.read_text()

    def travel(self):
        """Return the last measured travel of the rollers."""
        return np.array(self.w.probe.last('joints').position)

    def moving(self):
        """Return whether the last joint states tell of a motion."""
        joints = self.w.probe.last('joints')
        return joints is not None and any(joints.velocity)

    def until_moving(self):
        """Command a twist until the rollers move, heard from now on."""
        for key in ('joints', 'status'):
            self.w.probe.seen[key].clear()
        self.until(lambda: self.moving() and self.w.code() == Status.OK)

    def until(self, what):
        """Command a twist to and fro until something holds."""

        def each():
            for process in self._alive.values():
                process.require_running()
            swing = 0.02 * np.cos(np.pi * time.monotonic())
            self.w.probe.send_twist((0.0, swing, 0.0))

        self.w.until(what, each)

    def check_at_rest(self):
        """Check that the rollers stand still for some time in spite of twists."""
        at = self.travel()
        count = len(self.w.probe.seen['joints'])
        self.until(lambda: len(self.w.probe.seen['joints']) > count + 30)
        assert not any(any(m.velocity) for _, m in self.w.probe.seen['joints'][count:])
        assert np.array_equal(self.travel(), at)


@contextlib.contextmanager
def robot(logs):
    """Return a robot of processes; they are stopped at the end."""
    with world() as w:
        made = Robot(w, logs)
        try:
            yield made
        finally:
            made.close()


def test_each_node_is_killed_in_mid_motion_and_started_again(tmp_path):
    with robot(tmp_path) as r:
        w = r.w
        for name in ('simulator', 'manipulation', 'grasp_analysis'):
            r.start(name)
        r.until_moving()
        r.until(lambda: w.code('state') == GraspState.OK)

        r.signal('manipulation', signal.SIGKILL)
        at = r.travel()
        r.until(lambda: not r.moving())
        assert np.abs(r.travel() - at).max() < MAX_SPEED * (TIMEOUT + SLACK)
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


def test_a_node_that_hangs_stops_the_rollers_and_goes_on_when_it_is_back(tmp_path):
    with robot(tmp_path) as r:
        for name in ('simulator', 'manipulation'):
            r.start(name)
        r.until_moving()
        r.signal('manipulation', signal.SIGSTOP)
        at = r.travel()
        r.until(lambda: not r.moving())
        assert np.abs(r.travel() - at).max() < MAX_SPEED * (TIMEOUT + SLACK)
        r.check_at_rest()
        r.signal('manipulation', signal.SIGCONT)
        r.until_moving()
        r.signal('simulator', signal.SIGSTOP)
        r.until(lambda: r.w.code() >= Status.HALT_NO_TWIST and not r.w.command().any())
        r.signal('simulator', signal.SIGCONT)
        r.until_moving()


def test_a_stop_outlives_the_node_that_obeys_it(tmp_path):
    with robot(tmp_path) as r:
        w = r.w
        r.start('simulator')
        r.start('manipulation')
        r.until_moving()
        w.probe.stops.publish(Bool(data=True))
        r.until(lambda: w.code() == Status.HALT_EMERGENCY_STOP and not r.moving())
        r.check_at_rest()
        r.signal('manipulation', signal.SIGKILL)
        w.probe.seen['status'].clear()
        w.probe.seen['command'].clear()
        r.start('manipulation', require_emergency_stop=True)
        r.until(lambda: len(w.probe.seen['status']) > 50)
        assert {m.code for _, m in w.probe.seen['status']} == {Status.HALT_EMERGENCY_STOP}
        assert not any(any(m.data) for _, m in w.probe.seen['command'])
        r.check_at_rest()


#: A manipulation node with a mistake of ours in it, for once.
MISTAKEN = """
import sys
from isotruss_ros.nodes.manipulation import Manipulation
from isotruss_ros.nodes.runner import run


class Mistaken(Manipulation):
    mistakes = 0

    def _step(self, now):
        super()._step(now)
        if not self.mistakes and self._servo.rollers is not None:
            self.mistakes += 1
            raise ZeroDivisionError('a mistake')


sys.exit(run(Mistaken))
"""


def test_a_mistake_of_ours_leaves_the_rollers_at_zero_and_a_node_that_answers(tmp_path):
    script, log = tmp_path / 'mistaken.py', tmp_path / 'mistaken.txt'
    script.write_text(MISTAKEN)
    with robot(tmp_path) as r, log.open('wb') as output:
        w = r.w
        process = subprocess.Popen([sys.executable, str(script)], stdout=output, stderr=output)
        try:
            r.start('simulator')
            r.until(lambda: 'a mistake' in w.report('manipulation').message)
            w.probe.seen['joints'].clear()
            r.until(lambda: bool(w.probe.seen['joints']) and not r.moving())
            assert not w.command().any()
            r.check_at_rest()
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
