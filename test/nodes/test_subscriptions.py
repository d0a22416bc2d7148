# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The newest message of a topic counts."""

from geometry_msgs.msg import PoseStamped
from isotruss_ros.nodes.framework.topics import NEWEST, subscribe_newest, take_waiting
from probe import begin_context
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor


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


def test_what_waits_can_be_discarded(topic):
    subscription, seen, executor = topic
    assert len(take_waiting([], subscription, NEWEST.depth)) == NEWEST.depth
    for _ in range(5):
        executor.spin_once(timeout_sec=0.1)
    assert not seen
