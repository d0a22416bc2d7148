# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Nodes as processes run them: cycles by the clock, other callbacks before each, newest inputs."""

import subprocess
import sys
import time
from types import SimpleNamespace

from geometry_msgs.msg import PoseStamped, Twist
from isotruss_ros.nodes.framework.cycle import Cycle, PacedExecutor
from isotruss_ros.nodes.framework.topics import subscribe_newest
from probe import begin_context, manipulation, Probe
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger


@pytest.fixture
def nodes():
    """Return a running node, a probe and the node's executor."""
    begin_context()
    node = manipulation(rate=200.0, command_timeout=10.0)()
    probe = Probe(Twist)
    yield node, probe, PacedExecutor(node)
    node.stop()
    node.destroy_node()
    probe.destroy_node()
    rclpy.shutdown()


def test_no_cycle_waits_for_an_import():
    loaded = "{'scipy.optimize', 'scipy.interpolate'} <= set(sys.modules)"
    asked = f'import sys; import isotruss_ros.nodes.framework.runner; assert {loaded}'
    subprocess.run([sys.executable, '-c', asked], check=True, timeout=300)


#: A node that waits for nothing, and gets a signal meanwhile.
IDLE = """
import os, signal, threading
from isotruss_ros.nodes.framework.runner import run, StoppableNode

class Idle(StoppableNode):
    node_name, specs = 'idle', ()

    def begin(self):
        threading.Timer(1.0, os.kill, (os.getpid(), signal.SIGINT)).start()

raise SystemExit(run(Idle))
"""


def test_a_signal_ends_a_node_without_a_timer():
    subprocess.run([sys.executable, '-c', IDLE], check=True, timeout=60)


def until(executor, probe, what, each=lambda: None):
    """Spin node and probe until something holds."""
    end = time.monotonic() + 240.0
    while not what():
        assert time.monotonic() < end
        each()
        executor.spin_once(timeout_sec=0.01)
        rclpy.spin_once(probe, timeout_sec=0.0)


def moving(probe):
    """Return whether the last command moves the rollers."""
    command = probe.last('command')
    return command is not None and any(command.data)


def send_inputs(probe):
    """Publish the measured inputs."""
    probe.send_joints()
    probe.send_pose()


def move(executor, probe):
    """Spin until a twist moves the rollers."""
    until(executor, probe, lambda: moving(probe), probe.send_all)


def test_cycles_and_services_both_run(nodes):
    _node, probe, executor = nodes
    move(executor, probe)
    client = probe.create_client(Trigger, 'emergency_stop')
    until(executor, probe, client.service_is_ready)
    answer = client.call_async(Trigger.Request())
    until(executor, probe, answer.done)
    assert 'emergency_stop' in answer.result().message
    until(executor, probe, lambda: not moving(probe), probe.send_all)


def test_a_twist_from_before_the_activation_moves_nothing(nodes):
    node, probe, executor = nodes
    move(executor, probe)
    node.trigger_deactivate()
    until(executor, probe, lambda: not moving(probe), probe.send_all)
    for _ in range(20):
        probe.send_all()
        rclpy.spin_once(probe, timeout_sec=0.01)
    node.trigger_activate()
    probe.seen['command'].clear()
    until(executor, probe, lambda: len(probe.seen['command']) > 5, lambda: send_inputs(probe))
    assert not any(any(m.data) for _, m in probe.seen['command'])
    move(executor, probe)


def test_an_error_of_a_callback_reaches_the_caller(nodes):
    node, probe, executor = nodes

    def fail():
        raise ArithmeticError('of a timer')

    node.create_timer(0.001, fail)
    with pytest.raises(ArithmeticError, match='of a timer'):
        until(executor, probe, lambda: False)


def test_a_cycle_begins_with_the_time_that_waits_behind_other_messages():
    begin_context()
    node = rclpy.create_node('cycle', parameter_overrides=[Parameter('use_sim_time', value=True)])
    other, arrived, seen = rclpy.create_node('witness'), [], []
    other.create_subscription(Clock, '/clock', arrived.append, 10)
    node.values, node.inputs = SimpleNamespace(rate=100.0, command_timeout=1.0), None
    cycle = Cycle(node, seen.append, lambda: None)
    message = Clock()
    message.clock.sec = 7
    publisher = other.create_publisher(Clock, '/clock', 10)
    while node.get_clock().now().nanoseconds == 0 and len(seen) < 1000:
        publisher.publish(message)
        rclpy.spin_once(other)
        # No executor delivers it.
        cycle.run()
    assert seen[-1] == 7.0
    node.destroy_node()
    other.destroy_node()
    rclpy.shutdown()


@pytest.fixture
def topic():
    """Publish 0 to 4 on a topic; return its subscription, what that has seen, and an executor."""
    begin_context()
    node, seen, arrived = rclpy.create_node('listener'), [], []
    subscription = subscribe_newest(
        node, PoseStamped, 'poses', lambda message: seen.append(message.pose.position.x)
    )
    other = rclpy.create_node('witness')
    other.create_subscription(PoseStamped, 'poses', arrived.append, 10)
    publisher = other.create_publisher(PoseStamped, 'poses', 10)
    message = PoseStamped()
    for number in range(5):
        message.pose.position.x = float(number)
        publisher.publish(message)
    while len(arrived) < 5:
        rclpy.spin_once(other)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    yield subscription, seen, executor
    node.destroy_node()
    other.destroy_node()
    rclpy.shutdown()


def test_the_newest_message_counts(topic):
    _subscription, seen, executor = topic
    for _ in range(5):
        executor.spin_once(timeout_sec=0.1)
    assert seen == [4.0]
