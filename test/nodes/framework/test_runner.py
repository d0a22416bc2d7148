# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Nodes as processes run them: cycles by the clock, other callbacks before each, newest inputs."""

import time

from geometry_msgs.msg import PoseStamped, Twist
from isotruss_ros.nodes.framework.cycle import PacedExecutor
from isotruss_ros.nodes.framework.topics import subscribe_newest
from probe import begin_context, DEADLINE, manipulation, Probe
import pytest
import rclpy
from rclpy.executors import Executor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node

#: Methods of rclpy's handles: class, and functions of rclpy that call the method.
CALLS = {
    'call_timer': (rclpy_implementation.Timer, [Executor._take_timer]),
    'take_message': (rclpy_implementation.Subscription, [Executor._take_subscription]),
    'get_parameters': (rclpy_implementation.Node, [Node.__init__]),
}


@pytest.fixture(params=CALLS)
def renamed(request, monkeypatch):
    """Replace rclpy by one in which a method of a handle has another name."""
    kind, callers = CALLS[request.param]
    monkeypatch.setattr(kind, 'renamed', getattr(kind, request.param), raising=False)
    monkeypatch.delattr(kind, request.param)
    for caller in callers:
        names = [n if n != request.param else 'renamed' for n in caller.__code__.co_names]
        monkeypatch.setattr(caller, '__code__', caller.__code__.replace(co_names=tuple(names)))


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


def until(executor, probe, holds, send=lambda: None):
    """Spin node and probe until a condition holds."""
    end = time.monotonic() + DEADLINE
    while not holds():
        assert time.monotonic() < end
        send()
        executor.spin_once(timeout_sec=0.01)
        rclpy.spin_once(probe, timeout_sec=0.0)


def moving(probe):
    command = probe.last('command')
    return command is not None and any(command.data)


def move(executor, probe):
    until(executor, probe, lambda: moving(probe), probe.send_all)


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
    until(executor, probe, lambda: len(probe.seen['command']) > 5, probe.send_measured)
    assert not any(any(m.data) for _, m in probe.seen['command'])
    move(executor, probe)


def test_a_twist_moves_the_rollers_with_an_rclpy_that_lacks_a_method_of_handles(renamed, nodes):
    node, probe, executor = nodes
    assert node.values.rate == 200.0
    move(executor, probe)


def test_the_newest_message_of_a_burst_is_used():
    begin_context()
    node, used, arrived = rclpy.create_node('listener'), [], []
    subscribe_newest(node, PoseStamped, 'poses', lambda pose: used.append(pose.pose.position.x))
    other = rclpy.create_node('witness')
    other.create_subscription(PoseStamped, 'poses', arrived.append, 10)
    publisher, message = other.create_publisher(PoseStamped, 'poses', 10), PoseStamped()
    for number in range(5):
        message.pose.position.x = float(number)
        publisher.publish(message)
    while len(arrived) < 5:
        rclpy.spin_once(other)
    for _ in range(5):
        rclpy.spin_once(node, timeout_sec=0.1)
    assert used == [4.0]
    node.destroy_node()
    other.destroy_node()
    rclpy.shutdown()
