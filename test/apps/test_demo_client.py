# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The demonstration's node hears every topic, however many messages one of them has."""

from geometry_msgs.msg import PoseStamped
from isotruss_msgs.msg import ManipulationStatus
from isotruss_ros.core import load_robot
from isotruss_ros.demo.client import DemoClient
from isotruss_ros.nodes.framework.topics import RELIABLE
from probe import begin_context
import pytest
import rclpy


@pytest.fixture
def other():
    """Return a node beside the client's."""
    begin_context()
    yield rclpy.create_node('other')
    rclpy.shutdown()


def test_a_full_queue_of_one_topic_does_not_delay_other_topics(other):
    client = DemoClient(load_robot('triangle').roller_names)
    poses = other.create_publisher(PoseStamped, 'object_pose', 200)
    statuses = other.create_publisher(ManipulationStatus, 'manipulation/status', RELIABLE)
    client.wait(
        lambda: poses.get_subscription_count() and statuses.get_subscription_count(),
        lambda: None,
        'discovery',
    )
    rounds = []

    def publish():
        rounds.append(None)
        for _ in range(200):
            poses.publish(PoseStamped())
        if len(rounds) == 3:
            statuses.publish(ManipulationStatus(message='heard'))
        assert len(rounds) < 100

    record = client.begin('flood')
    client.wait(lambda: record.statuses, lambda: None, 'a status', meanwhile=publish)
