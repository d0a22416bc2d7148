# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stop and failed rollers over DDS: what follows, what was lost, and what came before the node."""

import os
import subprocess
import sys

from diagnostic_msgs.msg import DiagnosticArray
from isotruss_ros.core import Status
from probe import failed, ROBOT, world
from probe import manipulation as node
import pytest
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Bool

pytestmark = pytest.mark.system
LONG = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
PLAIN = QoSProfile(depth=1000)
HASTY = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
HELD = """
import sys
import rclpy
from rclpy.qos import QoSProfile, DurabilityPolicy
from std_msgs.msg import Bool

rclpy.init()
profile = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
publisher = rclpy.create_node('button').create_publisher(Bool, 'emergency_stop', profile)
publisher.publish(Bool(data=True))
print('published', flush=True)
sys.stdin.read()
"""


def test_a_publisher_that_does_not_latch_is_not_told_that_its_messages_are_not_sent():
    told = []
    with world() as w:
        w.probe.destroy_publisher(w.probe.stops)
        w.add(node()())
        publisher = w.probe.create_publisher(
            Bool,
            'emergency_stop',
            PLAIN,
            event_callbacks=PublisherEventCallbacks(incompatible_qos=told.append),
        )
        w.until_code(Status.OK, w.probe.send_all)
        publisher.publish(Bool(data=True))
        w.until_code(Status.HALT_EMERGENCY_STOP, w.probe.send_all)
    assert not told


@pytest.mark.parametrize('is_first', [True, False])
def test_what_a_latching_publisher_published_before_its_match_counts(is_first):
    """Of another process, begun before the node, or after it while it is unconfigured."""
    command, pipe = [sys.executable, '-c', HELD], subprocess.PIPE
    with world() as w:
        w.probe.destroy_publisher(w.probe.stops)
        if not is_first:
            w.add(node(autostart=False)())
        button = subprocess.Popen(command, stdin=pipe, stdout=pipe)
        try:
            button.stdout.readline()
            if is_first:
                w.add(node()())
            w.until(lambda: 'stopped by the topic' in w.detail('emergency stop'))
        finally:
            button.communicate()


def test_lost_messages_count_as_a_stop():
    """Far more than is kept for the node while it does not look."""
    with world(node()) as w:
        publisher = w.probe.create_publisher(Bool, 'emergency_stop', LONG)
        w.until(lambda: publisher.get_subscription_count() == 2)
        w.until_code(Status.OK, w.probe.send_all)
        for _ in range(7000):
            publisher.publish(Bool(data=False))
        status = w.until_code(Status.HALT_EMERGENCY_STOP, w.probe.send_all)
        assert 'messages of emergency_stop were lost' in status.message
        assert 'release_emergency_stop' in status.message


@pytest.mark.parametrize(
    'words', [('--namespace', '/left'), ('--ros-args', '-r', '__ns:=/left'), ()], ids=' '.join
)
def test_the_command_stop_stops_the_robot_of_its_namespace(words):
    with world(remaps=['__ns:=/left'] if words else []) as w:
        w.add(node()())
        w.until_code(Status.OK, w.probe.send_all)
        # A stop needs no folder for the log of ROS.
        environment = os.environ | {'HOME': '', 'ROS_HOME': '', 'ROS_LOG_DIR': ''}
        command = subprocess.Popen(
            [sys.executable, '-m', 'isotruss_ros.executables', 'stop', *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=environment,
        )
        w.until(lambda: command.poll() is not None, w.probe.send_all)
        said, failure = command.communicate()
        assert command.returncode == 0, failure
        w.until_code(Status.HALT_EMERGENCY_STOP, w.probe.send_all)
        assert f'{"/left" if words else ""}/release_emergency_stop' in said
        if not words:
            release = [sys.executable, '-m', 'isotruss_ros.executables', 'release']
            with subprocess.Popen(release) as command:
                w.until(lambda: command.poll() is not None, w.probe.send_all)
            w.until_code(Status.OK, w.probe.send_all)


SERVER = """
import rclpy
from std_srvs.srv import Trigger

def stop(_, response):
    response.success, response.message = True, 'stopped'
    return response

rclpy.init()
node = rclpy.create_node('manipulation')
node.create_service(Trigger, 'emergency_stop', stop)
print('ready', flush=True)
rclpy.spin(node)
"""


@pytest.mark.parametrize('place', ['HOME=/proc', 'ROS_LOG_DIR=/proc/x'])
def test_the_command_stop_needs_no_place_for_logs(place):
    name, _, value = place.partition('=')
    environment = {
        key: v for key, v in os.environ.items() if key not in ('ROS_LOG_DIR', 'ROS_HOME')
    }
    with subprocess.Popen([sys.executable, '-c', SERVER], stdout=subprocess.PIPE) as server:
        try:
            server.stdout.readline()
            done = run_stop(environment | {name: value})
        finally:
            server.kill()
    assert done.returncode == 0, done.stderr
    assert done.stdout == 'isotruss stop: STOPPED: stopped\n'


def run_stop(environment, *words):
    command = [sys.executable, '-m', 'isotruss_ros.executables', 'stop', *words]
    return subprocess.run(command, capture_output=True, text=True, env=environment)


@pytest.mark.parametrize(
    ('variable', 'words'),
    [
        ('ROS_DOMAIN_ID=500', ()),
        ('ROS_DOMAIN_ID=none', ()),
        ('RMW_IMPLEMENTATION=rmw_none', ()),
        ('AMENT_PREFIX_PATH=', ('--unknown',)),
        ('AMENT_PREFIX_PATH=', ('--namespace', 'a b')),
        ('AMENT_PREFIX_PATH=', ('--ros-args', '-r', ':=')),
    ],
    ids=str,
)
def test_the_last_words_of_a_stop_that_fails_are_not_confirmed(variable, words):
    name, _, value = variable.partition('=')
    done = run_stop(os.environ | {name: value}, *words)
    assert done.returncode != 0
    assert 'NOT CONFIRMED' in done.stderr.splitlines()[-1]


def test_the_command_stop_imports_neither_core_nor_messages_of_the_robot():
    code = 'import sys, isotruss_ros.executables, isotruss_ros.cli.stop; print(*sys.modules)'
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    slow = ('numpy', 'scipy', 'isotruss_msgs', 'isotruss_ros.core', 'isotruss_ros.nodes')
    assert not [name for name in done.stdout.split() if name.startswith(slow)]


def test_a_best_effort_publisher_counts_as_a_stop():
    with world(node()) as w:
        w.until_code(Status.OK, w.probe.send_all)
        w.probe.create_publisher(Bool, 'emergency_stop', HASTY)
        status = w.until_code(Status.HALT_EMERGENCY_STOP, w.probe.send_all)
        assert 'a publisher of emergency_stop is best-effort' in status.message


FIRST = ROBOT.roller_names[0]
LOSSES = {
    ReliabilityPolicy.BEST_EFFORT: 'is best-effort',
    ReliabilityPolicy.RELIABLE: 'left before a message was received',
}


@pytest.mark.parametrize('reliability', LOSSES)
def test_halts_where_a_message_may_have_been_lost_until_there_is_another(reliability):
    with world(node()) as w:
        w.until_code(Status.OK, w.probe.send_all)
        profile = QoSProfile(depth=1, reliability=reliability)
        publisher = w.probe.create_publisher(DiagnosticArray, 'failed_rollers', profile)
        if reliability == ReliabilityPolicy.RELIABLE:
            w.until(lambda: publisher.get_subscription_count() == 1, w.probe.send_all)
            w.probe.destroy_publisher(publisher)
        status = w.until_code(Status.HALT_INVALID_FAILED_ROLLERS, w.probe.send_all)
        assert LOSSES[reliability] in status.message
        other = w.probe.create_publisher(DiagnosticArray, 'failed_rollers', 10)
        w.until(lambda: other.get_subscription_count() == 1, w.probe.send_all)
        other.publish(failed(FIRST))
        w.until(lambda: w.code() < Status.HALT_NO_TWIST, w.probe.send_all)
        assert list(w.probe.last('status').failed_rollers) == [FIRST]
