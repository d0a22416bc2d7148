# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The demonstration's node hears every topic, however many messages one of them has."""

import contextlib

from geometry_msgs.msg import PoseStamped
from isotruss_msgs.msg import ManipulationStatus
from isotruss_ros.core import load_robot, Status
from isotruss_ros.demo.client import DemoClient, DemoError, FINAL_HALTS
from isotruss_ros.nodes.conversions.messages import make_header
from isotruss_ros.nodes.framework.topics import RELIABLE
import numpy as np
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


@pytest.mark.parametrize('code', [*FINAL_HALTS, Status.HALT_STALE_JOINT_STATES])
def test_a_halt_that_does_not_end_by_itself_ends_the_wait_with_its_reason(other, code):
    client = DemoClient(load_robot('triangle').roller_names)
    statuses = other.create_publisher(ManipulationStatus, 'manipulation/status', RELIABLE)
    stamps = []

    def publish():
        stamps.append(0.1 * len(stamps))
        header = make_header(stamps[-1])
        statuses.publish(ManipulationStatus(header=header, code=code, message='1.01 s old'))

    ends = code in FINAL_HALTS
    expected = pytest.raises(DemoError, match=f'{code}: 1.01 s old')
    with expected if ends else contextlib.nullcontext():
        client.wait(lambda: not ends and len(stamps) > 150, lambda: None, 'arrival', 20.0, publish)


def test_sums_of_commanded_and_executed_twists_have_one_interval_and_lose_no_status(other):
    """Three seconds of statuses arrive while the client is suspended."""
    client = DemoClient(load_robot('triangle').roller_names)
    statuses = other.create_publisher(ManipulationStatus, 'manipulation/status', 1000)
    client.wait(lambda: statuses.get_subscription_count(), lambda: None, 'discovery')
    times = 0.01 * np.arange(301)
    speeds = 0.02 * np.sin(np.pi * times / 3.0) ** 2
    for time, speed in zip(times, speeds, strict=True):
        message = ManipulationStatus(header=make_header(time), scale=0.5)
        message.commanded.linear.x = float(speed)
        statuses.publish(message)
    record = client.begin('suspended')
    client.wait(lambda: len(client._status_times) == 301, lambda: None, 'all statuses', 20.0)
    assert record.commanded == pytest.approx([0.03, 0.0, 0.0], abs=1e-9)
    assert record.accepted == pytest.approx([0.015, 0.0, 0.0], abs=1e-9)
