# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The demonstration's node hears every topic, however many messages one of them has."""

from geometry_msgs.msg import PoseStamped, WrenchStamped
from isotruss_msgs.msg import ManipulationStatus, StateEstimate
from isotruss_ros.core import load_robot
from isotruss_ros.demo.client import DemoClient
from isotruss_ros.nodes.conversions.marker_messages import to_joint_markers
from isotruss_ros.nodes.framework.topics import RELIABLE
from probe import begin_context
import pytest
import rclpy
from sensor_msgs.msg import JointState


@pytest.fixture
def other():
    """Return a node beside the client's."""
    begin_context()
    yield rclpy.create_node('other')
    rclpy.shutdown()


def test_the_truth_is_recorded_beside_what_is_measured(other):
    names = load_robot('triangle').roller_names
    client = DemoClient(names, truth=True)
    topics = {
        'object_pose': PoseStamped(),
        'truth/object_pose': PoseStamped(),
        'truth/contact_forces': WrenchStamped(),
        'truth/joint_markers': to_joint_markers({'A': (1.0, 2.0)}),
        'state_estimate': StateEstimate(offsets=[0.1, 0.2]),
        'joint_states': JointState(name=names, position=[1.0, 1.0]),
    }
    topics['object_pose'].pose.position.x = 1.0
    topics['truth/object_pose'].pose.position.x = 2.0
    topics['truth/contact_forces'].wrench.force.x = 4.0
    made = {
        topic: other.create_publisher(type(message), topic, RELIABLE)
        for topic, message in topics.items()
    }
    record = client.begin('truth')

    def publish():
        for topic, message in topics.items():
            made[topic].publish(message)

    client.wait(
        lambda: (
            client.pose
            and client.measured
            and any(record.squeezes)
            and record.joints
            and client.rollers is not None
            and client.rollers[0] != 1.0
        ),
        lambda: None,
        'all topics',
        meanwhile=publish,
    )
    assert (client.measured.x, client.pose.x) == (1.0, 2.0)
    assert max(record.squeezes) == 4.0
    assert record.joints[-1].tolist() == [[1.0, 2.0]]
    assert client.rollers == pytest.approx([1.1, 1.2])
    assert record.estimates


def test_a_topic_with_a_full_queue_starves_no_other(other):
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
