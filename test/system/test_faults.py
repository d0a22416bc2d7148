# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
One robot whose nodes are killed, hang or fail in mid-motion, or are stopped by another process.

It rests until somebody asks anew, and what is started again works.
"""

import signal
import subprocess
import sys
import time

from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import PoseStamped
from isotruss_msgs.action import FollowObjectPath
from isotruss_msgs.msg import GraspState
from isotruss_ros.core import Pose, Status
from isotruss_ros.nodes.conversions.messages import to_pose_message
from nav_msgs.msg import Path
from nightly import some_now
import numpy as np
from probe import DEADLINE, Manager, N, ROBOT
import pytest
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, QoSProfile
from robot_processes import robot
from std_msgs.msg import Bool
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

pytestmark = [pytest.mark.system, pytest.mark.xdist_group('one robot')]

#: The nodes and their parameters: a goal ends when inputs are late, as a busy machine makes them.
NODES = {
    'simulator': {'rate': 50.0},
    'manipulation': {'rate': 50.0},
    'grasp_analysis': {'rate': 20.0},
    'path_follower': {'rate': 50.0, 'command_timeout': 5.0},
}
Result = FollowObjectPath.Result


def start(r, name, **values):
    """Start a node."""
    r.start(name, **NODES[name], **values)


@pytest.fixture(scope='module')
def processes(shared_domain, tmp_path_factory):
    """Return the robot of all tests, of which nothing runs yet."""
    with robot(tmp_path_factory.mktemp('nodes')) as made:
        yield made


@pytest.fixture
def r(processes, request):
    """Return the robot, all of whose nodes run unless a test fails, and nothing stops it."""
    for name in NODES.keys() - processes.alive.keys():
        start(processes, name)
    release(processes)
    failures = request.session.testsfailed
    yield processes
    if request.session.testsfailed > failures:
        processes.kill()


def release(r):
    """Release an emergency stop."""
    r.w.probe.stops.publish(Bool(data=False))
    r.w.until(lambda: r.w.release_stop().success)


def test_each_node_is_killed_in_mid_motion_and_started_again(r):
    w = r.w
    r.until_moving()
    r.until(lambda: w.code('state') == GraspState.OK)

    r.signal('manipulation', signal.SIGKILL)
    r.check_at_rest()
    start(r, 'manipulation')
    r.until_moving()

    r.signal('simulator', signal.SIGKILL)
    r.until(lambda: w.code() in (Status.HALT_STALE_JOINT_STATES, Status.HALT_STALE_OBJECT_POSE))
    r.until(lambda: not w.command().any())
    r.until(lambda: w.code('state') == GraspState.STALE_JOINT_STATES)
    assert not w.probe.last('state').force_closure
    # The robot is elsewhere, at home, when it is back: the motion goes on from there.
    start(r, 'simulator')
    r.until_moving()
    r.until(lambda: w.code('state') == GraspState.OK)

    r.signal('grasp_analysis', signal.SIGKILL)
    r.until_moving()
    w.probe.seen['state'].clear()
    start(r, 'grasp_analysis')
    r.until(lambda: w.code('state') == GraspState.OK)


def test_a_suspended_node_stops_the_rollers_and_resumes(r):
    r.until_moving()
    r.signal('manipulation', signal.SIGSTOP)
    r.check_at_rest()
    r.signal('manipulation', signal.SIGCONT)
    r.until_moving()
    r.signal('simulator', signal.SIGSTOP)
    r.until(lambda: r.w.code() >= Status.HALT_NO_TWIST and not r.w.command().any())
    r.signal('simulator', signal.SIGCONT)
    r.until_moving()


ONCE = """
import time
import rclpy
from rclpy.qos import QoSProfile, DurabilityPolicy
from std_msgs.msg import Bool

rclpy.init()
durability = DurabilityPolicy.{durability}
profile = QoSProfile(depth=1, durability=durability)
publisher = rclpy.create_node('button').create_publisher(Bool, 'emergency_stop', profile)
while not publisher.get_subscription_count():
    time.sleep(0.001)
publisher.publish(Bool(data=True))
time.sleep(0.1)
"""


@pytest.mark.parametrize('durability', some_now(['VOLATILE', 'TRANSIENT_LOCAL']))
def test_a_process_that_publishes_once_and_exits_stops_the_robot(r, durability):
    """As `ros2 topic pub --once` does: after the first match, and gone 0.1 s later."""
    r.until_moving()
    subprocess.run([sys.executable, '-c', ONCE.format(durability=durability)], check=True)
    r.until(lambda: r.w.code() == Status.HALT_EMERGENCY_STOP)
    r.check_at_rest()


def test_a_stop_counts_however_many_messages_follow_from_another_process(r):
    latched = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publisher = r.w.probe.create_publisher(Bool, 'emergency_stop', latched)
    r.w.until(lambda: publisher.get_subscription_count() == 2)
    for count in (1, 500):
        r.until_moving()
        publisher.publish(Bool(data=True))
        for _ in range(count):
            publisher.publish(Bool(data=False))
        r.until(lambda: r.w.code() == Status.HALT_EMERGENCY_STOP)
        r.until(lambda: 'message is false' in r.w.probe.last('status').message)
        release(r)
    r.w.probe.destroy_publisher(publisher)


def test_a_latched_stop_persists_when_the_node_restarts(r):
    w = r.w
    r.until_moving()
    w.probe.stops.publish(Bool(data=True))
    r.until(lambda: w.code() == Status.HALT_EMERGENCY_STOP)
    r.check_at_rest()
    r.alive.pop('manipulation').stop()
    w.probe.seen['status'].clear()
    w.probe.seen['command'].clear()
    start(r, 'manipulation', require_emergency_stop=True)
    r.until(lambda: len(w.probe.seen['status']) > 50)
    assert {m.code for _, m in w.probe.seen['status']} == {Status.HALT_EMERGENCY_STOP}
    assert not any(any(m.data) for _, m in w.probe.seen['command'])
    r.check_at_rest()


def test_two_manipulation_nodes_halt_until_one_of_them_ends(r):
    r.until_moving()
    r.alive['first'] = r.alive['manipulation']
    start(r, 'manipulation')
    heard = r.w.probe.seen['status']

    def both_halt():
        # One after the other, from two nodes that publish at the same rate.
        codes = [message.code for _, message in heard[-100:]]
        return len(codes) == 100 and {*codes} == {Status.HALT_OTHER_COMMANDS}

    r.until(both_halt)
    assert 'another node publishes on roller_velocity' in r.w.probe.last('status').message
    r.check_at_rest()
    r.alive.pop('first').stop()
    heard.clear()
    r.until_moving()
    assert not any(message.failed_rollers for _, message in heard)


#: A manipulation node with a mistake of ours in it, for once.
MISTAKEN = """
import sys
from isotruss_ros.nodes.manipulation.node import Manipulation
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


def test_an_unexpected_error_stops_the_rollers_and_the_services_remain(r, tmp_path):
    script, log = tmp_path / 'mistaken.py', tmp_path / 'mistaken.txt'
    script.write_text(MISTAKEN)
    r.alive.pop('manipulation').stop()
    with log.open('wb') as output:
        process = subprocess.Popen([sys.executable, str(script)], stdout=output, stderr=output)
        try:
            r.until(lambda: 'a mistake' in r.w.report('manipulation').message)
            r.check_at_rest()
            r.until(lambda: not r.w.command().any())
            manager = Manager(r.w, 'manipulation')
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


class Paths:
    """Asks for paths up and down from where the object is, as any action client does."""

    def __init__(self, r):
        self._r = r
        self._client = ActionClient(r.w.probe, FollowObjectPath, 'follow_object_path')
        self._asked, self._results = None, []

    def ask(self, height, speed=0.02):
        """Send a goal; return the future of its handle."""
        here = self._r.w.probe.last('pose').pose.position
        ends = [Pose(here.x, here.y, 0.0), Pose(here.x, here.y + height, 0.0)]
        path = Path(poses=[PoseStamped(pose=to_pose_message(pose)) for pose in ends])
        path.header.frame_id = 'truss'
        goal = FollowObjectPath.Goal(path=path, speed=speed, angle_tolerance=3.0)
        return self._client.send_goal_async(goal)

    def go(self, height, speed=0.02):
        """Ask until the object moves; return the handle of the goal."""
        w = self._r.w
        self._asked = None

        def each():
            if not self._pursued():
                self._asked, self._results = self.ask(height, speed), []

        w.until(lambda: w.probe.last('pose') is not None)
        w.until(self._r.moving, each, period=3.0)
        return self.accepted(self._asked)

    def _pursued(self):
        """
        Return whether the last goal was accepted and is not over.

        A server that was killed is there for a while and does not answer, and a goal may end at
        once where inputs are not all there.
        """
        if self._asked is None or not self._asked.done() or not self._asked.result().accepted:
            return False
        if any(result.done() for result in self._results):
            return False
        self._results.append(self._asked.result().get_result_async())
        return True

    def accepted(self, asked):
        """Return the handle of a goal."""
        self._r.w.until(asked.done)
        assert asked.result().accepted
        return asked.result()

    def ended(self, handle):
        """Wait for the end of a goal; return status of the action, code of the result."""
        found = self._r.w.ask(handle.get_result_async)
        return found.status, found.result.code


@pytest.mark.nightly
def test_a_path_ends_with_its_node_and_the_next_one_works(r):
    w, paths = r.w, Paths(r)
    r.check_rests()
    paths.go(0.2)
    r.signal('path_follower', signal.SIGKILL)
    r.check_rests()
    assert w.code() == Status.HALT_NO_TWIST
    start(r, 'path_follower')
    w.probe.seen['diagnostics'].clear()
    w.until(lambda: bool(w.report('path_follower').name))
    r.check_rests()  # nobody goes on with the old path
    status, code = paths.ended(paths.go(0.01))
    assert (status, code) == (GoalStatus.STATUS_SUCCEEDED, Result.REACHED)


@pytest.mark.nightly
def test_a_path_ends_one_timeout_after_manipulation_is_killed(r):
    w, paths = r.w, Paths(r)
    r.check_rests()
    handle = paths.go(0.2)
    w.until(r.moving)
    r.signal('manipulation', signal.SIGKILL)
    killed = time.monotonic()
    assert paths.ended(handle) == (GoalStatus.STATUS_ABORTED, Result.STOPPED)
    timeout = NODES['path_follower']['command_timeout']
    # Less than half of `progress_timeout`, which is for a robot that does not move.
    assert time.monotonic() - killed < timeout + 1.5


@pytest.mark.nightly
def test_a_path_is_cancelled_or_preempted_by_another_process(r):
    w, paths = r.w, Paths(r)
    r.check_rests()
    # So slowly that the next path still begins where the object is when it is asked for.
    first = paths.go(0.2, speed=0.001)
    second = paths.accepted(paths.ask(-0.2))
    assert paths.ended(first) == (GoalStatus.STATUS_ABORTED, Result.PREEMPTED)
    # The object goes the other way now.
    high = w.probe.last('pose').pose.position.y
    w.until(lambda: w.probe.last('pose').pose.position.y < high)
    # Who does not pursue it any more cannot be told to stop.
    late = first.cancel_goal_async()
    w.until(late.done)
    assert not late.result().goals_canceling
    w.until(r.moving)
    asked = second.cancel_goal_async()
    w.until(asked.done)
    assert len(asked.result().goals_canceling) == 1
    assert paths.ended(second) == (GoalStatus.STATUS_CANCELED, Result.CANCELLED)
    r.check_rests()


@pytest.mark.nightly
def test_a_trajectory_ends_with_its_node_and_the_next_one_works(r):
    w = r.w
    topic = 'joint_trajectory_controller/joint_trajectory'
    publisher = w.probe.create_publisher(JointTrajectory, topic, 1)

    def send(travel):
        begin = r.w.travel()
        points = [
            JointTrajectoryPoint(positions=(begin + share * travel).tolist())
            for share in (0.0, 1.0)
        ]
        points[1].time_from_start = Duration(sec=round(20.0 * np.abs(travel).max()))
        names = list(ROBOT.roller_names)
        publisher.publish(JointTrajectory(joint_names=names, points=points))

    r.check_rests()
    w.until(lambda: publisher.get_subscription_count() > 0)
    w.until(r.moving, lambda: send(np.full(N, 0.2)), period=0.5)
    r.signal('manipulation', signal.SIGKILL)
    r.check_rests()
    start(r, 'manipulation')
    w.probe.seen['status'].clear()
    w.until(lambda: w.code() == Status.HALT_NO_TWIST)
    r.check_rests()

    def again():
        # One from an old place is refused.
        if w.code() != Status.ARRIVED and not r.moving():
            send(np.full(N, -0.05))

    w.until(lambda: w.code() == Status.ARRIVED, again, period=2.0)
