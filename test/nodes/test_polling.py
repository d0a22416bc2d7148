"""Inputs that a cycle reads: the executor does not wake for them, and the newest is read."""

from geometry_msgs.msg import PoseStamped
from isotruss_ros.nodes.framework.polling import PolledGroup
from isotruss_ros.nodes.framework.subscriptions import subscribe_newest
from probe import begin_context
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor


@pytest.fixture
def node():
    """Return a node."""
    begin_context()
    made = rclpy.create_node('polling')
    yield made
    made.destroy_node()
    rclpy.shutdown()


def test_messages_wait_for_the_cycle_which_reads_the_newest(node):
    group, seen, woken = PolledGroup(), [], []
    subscribe_newest(node, PoseStamped, 'polled', lambda m: seen.append(m.pose.position.x), group)
    node.create_subscription(PoseStamped, 'polled', woken.append, 10)
    publisher = node.create_publisher(PoseStamped, 'polled', 10)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    message = PoseStamped()
    for number in range(5):
        message.pose.position.x = float(number)
        publisher.publish(message)
    while len(woken) < 5:
        executor.spin_once(timeout_sec=1.0)
    assert not seen
    group.take()
    assert seen == [4.0]
    group.take()
    assert seen == [4.0]
