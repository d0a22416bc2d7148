# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What a cycle reads: the executor does not wake for inputs, and the newest counts."""

import time

from geometry_msgs.msg import PoseStamped
from isotruss_ros.nodes.framework.polling import PolledGroup, read_clock
from isotruss_ros.nodes.framework.subscriptions import subscribe_newest
from probe import begin_context
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock


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


def test_the_clock_is_read_without_the_executor(node):
    read_clock(node)  # the system's: nothing to read
    node.set_parameters([Parameter('use_sim_time', value=True)])
    publisher = node.create_publisher(Clock, '/clock', 1)
    message, end = Clock(), time.monotonic() + 60.0
    message.clock.sec = 7
    while node.get_clock().now().nanoseconds != 7 * 10**9:
        assert time.monotonic() < end
        publisher.publish(message)
        read_clock(node)
