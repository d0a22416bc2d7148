# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A robot whose nodes are killed, hang or fail rests until somebody asks anew."""

import signal
import subprocess
import sys

from builtin_interfaces.msg import Duration
from isotruss_msgs.msg import GraspState
from isotruss_ros.core import Status
from nightly import some_now
import numpy as np
from probe import DEADLINE, Manager, N, ROBOT
import pytest
from robot_processes import robot
from std_msgs.msg import Bool
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

pytestmark = [pytest.mark.system, pytest.mark.xdist_group('one robot')]
#: Rates of the nodes by their names [Hz].
RATES = {'simulator': 50.0, 'manipulation': 50.0, 'grasp_analysis': 5.0}


def start(r, name):
    r.start(name, rate=RATES[name])


@pytest.fixture(scope='module')
def processes(shared_domain, tmp_path_factory):
    """Return the robot of all tests, of which nothing runs yet."""
    with robot(tmp_path_factory.mktemp('nodes')) as made:
        yield made


@pytest.fixture
def r(processes, request):
    """Return the robot, all of whose nodes run unless a test fails, and nothing stops it."""
    for name in RATES.keys() - processes.alive.keys():
        start(processes, name)
    processes.w.probe.stops.publish(Bool(data=False))
    processes.w.until(lambda: processes.w.release_stop().success)
    failures = request.session.testsfailed
    yield processes
    if request.session.testsfailed > failures:
        processes.kill()


ONCE = """
import time
import rclpy
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Bool

rclpy.init()
durability = DurabilityPolicy.{durability}
profile = QoSProfile(depth=1, durability=durability)
publisher = rclpy.create_node('button').create_publisher(Bool, 'emergency_stop', profile)
while publisher.get_subscription_count() < {subscriptions}:
    time.sleep(0.001)
publisher.publish(Bool(data=True))
assert publisher.wait_for_all_acked(Duration(seconds=60))
"""


# The manipulation node has a subscription that waits for latched messages, and one that does not.
@pytest.mark.parametrize(
    ('durability', 'subscriptions'), some_now([('VOLATILE', 1), ('TRANSIENT_LOCAL', 2)])
)
def test_a_process_that_publishes_once_and_exits_stops_the_robot(r, durability, subscriptions):
    """Gone as soon as the middleware has delivered the message."""
    r.until_moving()
    # Nodes of earlier tests are gone; one that was killed is 10 s later.
    r.w.until(lambda: r.w.probe.count_subscribers('emergency_stop') == 2)
    once = ONCE.format(durability=durability, subscriptions=subscriptions)
    subprocess.run([sys.executable, '-c', once], check=True)
    r.until(lambda: r.w.code() == Status.HALT_EMERGENCY_STOP)
    r.check_rests(in_spite_of_twists=True)


def test_each_node_is_killed_in_mid_motion_and_started_again(r):
    w = r.w
    r.until_moving()
    r.until(lambda: w.code('state') == GraspState.OK)

    r.signal('manipulation', signal.SIGKILL)
    r.check_rests(in_spite_of_twists=True)
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
    r.check_rests(in_spite_of_twists=True)
    r.signal('manipulation', signal.SIGCONT)
    r.until_moving()
    r.signal('simulator', signal.SIGSTOP)
    r.until(lambda: r.w.code() >= Status.HALT_NO_TWIST and not r.w.command().any())
    r.signal('simulator', signal.SIGCONT)
    r.until_moving()


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
    r.check_rests(in_spite_of_twists=True)
    r.alive.pop('first').stop()
    heard.clear()
    r.until_moving()
    assert not any(message.failed_rollers for _, message in heard)


#: Manipulation node with an error in a callback of a subclass.
FAULTY = """
import sys
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.framework.runner import run
from std_msgs.msg import Bool


class Faulty(Manipulation):
    def configure(self):
        super().configure()
        self.create_subscription(Bool, 'fault', lambda _: 1 / 0, 1)


sys.exit(run(Faulty))
"""


def test_an_unexpected_error_stops_the_rollers_and_the_services_remain(r, tmp_path):
    script, log = tmp_path / 'faulty.py', tmp_path / 'faulty.txt'
    script.write_text(FAULTY)
    faults = r.w.probe.create_publisher(Bool, 'fault', 1)
    r.alive.pop('manipulation').stop()
    with log.open('wb') as output:
        process = subprocess.Popen([sys.executable, str(script)], stdout=output, stderr=output)
        try:
            r.until_moving()
            r.until(
                lambda: 'division by zero' in r.w.report('manipulation').message,
                lambda: faults.publish(Bool()),
            )
            r.check_rests(in_spite_of_twists=True)
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


@pytest.mark.nightly
def test_a_trajectory_ends_with_its_node_and_the_next_one_works(r):
    w = r.w
    topic = 'joint_trajectory_controller/joint_trajectory'
    publisher = w.probe.create_publisher(JointTrajectory, topic, 1)

    def send(travel):
        begin = r.w.travel()
        rows = begin, begin + travel
        points = [JointTrajectoryPoint(positions=row.tolist()) for row in rows]
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
    # A trajectory that does not begin at the measured positions is refused.
    w.until(lambda: w.code() == Status.ARRIVED, lambda: send(np.full(N, -0.05)), period=10.0)
