# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The demonstration's node hears every topic; the lock of each ROS domain."""

import contextlib
import os
import subprocess
import sys

from geometry_msgs.msg import PoseStamped
from isotruss_msgs.msg import ManipulationStatus, StateEstimate
from isotruss_ros.core import load_robot, Status
from isotruss_ros.demo import domains
from isotruss_ros.demo.client import DemoClient, DemoError, FINAL_HALTS, REST_TIME
from isotruss_ros.demo.gripping import find_unknown_offsets
from isotruss_ros.nodes.conversions.messages import make_header
from isotruss_ros.nodes.framework.topics import RELIABLE
import numpy as np
from probe import begin_context
import pytest
import rclpy
from sensor_msgs.msg import JointState

ROBOT = load_robot('triangle')


@pytest.fixture
def other():
    begin_context()
    yield rclpy.create_node('other')
    rclpy.shutdown()


@pytest.fixture
def client(other):
    return DemoClient(ROBOT.roller_names)


def until(ready):
    return lambda: [] if ready() else ['the condition']


def test_rest_begins_anew_with_each_motion_of_object_or_rollers(client, other):
    poses = other.create_publisher(PoseStamped, 'object_pose', 10)
    joints = other.create_publisher(JointState, 'joint_states', 10)
    both = until(lambda: poses.get_subscription_count() and joints.get_subscription_count())
    client.wait(both, lambda: None, 'discovery')
    sent = JointState(name=ROBOT.roller_names, position=[0.0] * len(ROBOT.roller_names))
    known = until(lambda: client.rollers is not None)
    client.wait(known, lambda: None, 'rollers', 20.0, lambda: joints.publish(sent))
    record, rests = client.begin('rest'), []
    for count, x in enumerate([0.0] * 4 + [0.1] * 4):
        message = PoseStamped(header=make_header(1.0 + 0.6 * REST_TIME * count))
        message.pose.position.x, message.pose.orientation.w = x, 1.0
        poses.publish(message)
        received = until(lambda count=count: len(record.snapshots) > count)
        client.wait(received, lambda: None, 'a pose', 20.0)
        rests.append(not list(client.find_motion()))
    assert rests == [False, False, True, True, False, False, True, True]


def test_a_wait_that_fails_names_each_unmet_condition_with_value_and_bound(other):
    client = DemoClient(ROBOT.roller_names, truth=True)
    estimate = StateEstimate(
        roller_names=ROBOT.roller_names,
        offsets=[0.0] * 2,
        offset_covariance=[25e-6, 0.0, 0.0, 0.25e-6],
    )

    def find_unmet():
        yield from client.find_motion()
        yield from find_unknown_offsets([estimate])

    with pytest.raises(DemoError) as failed:
        client.wait(find_unmet, lambda: None, 'start', 0.1)
    assert 'no message of joint_states and truth/object_pose' in str(failed.value)
    (first, second) = ROBOT.roller_names
    assert f'roller {first} is 5 mm; must be at most 1 mm' in str(failed.value)
    assert second not in str(failed.value)


@pytest.mark.parametrize('code', [*FINAL_HALTS, Status.HALT_STALE_JOINT_STATES])
def test_a_halt_that_does_not_end_by_itself_ends_the_wait_with_its_reason(client, other, code):
    statuses = other.create_publisher(ManipulationStatus, 'manipulation/status', RELIABLE)
    stamps = []

    def publish():
        stamps.append(0.1 * len(stamps))
        header = make_header(stamps[-1])
        statuses.publish(ManipulationStatus(header=header, code=code, message='1.01 s old'))

    ends = code in FINAL_HALTS
    expected = pytest.raises(DemoError, match=f'{code}: 1.01 s old')
    with expected if ends else contextlib.nullcontext():
        arrived = until(lambda: not ends and len(stamps) > 150)
        client.wait(arrived, lambda: None, 'arrival', 20.0, publish)


def test_sums_of_commanded_and_executed_twists_have_one_interval_and_lose_no_status(client, other):
    """Three seconds of statuses arrive while the client is suspended."""
    statuses = other.create_publisher(ManipulationStatus, 'manipulation/status', 1000)
    client.wait(until(statuses.get_subscription_count), lambda: None, 'discovery')
    times = 0.01 * np.arange(301)
    speeds = 0.02 * np.sin(np.pi * times / 3.0) ** 2
    scales = np.where(times < 1.0, 0.5, 1.0)
    for time, speed, scale in zip(times, speeds, scales, strict=True):
        message = ManipulationStatus(header=make_header(time), scale=float(scale))
        message.commanded.linear.x = float(speed)
        statuses.publish(message)
    record = client.begin('suspended')
    final = pytest.approx([0.03, 0.0, 0.0], abs=1e-9)
    client.wait(until(lambda: record.commanded == final), lambda: None, 'all statuses', 20.0)
    executed = 0.01 * scales[:-1] @ speeds[:-1]
    assert record.accepted == pytest.approx([executed, 0.0, 0.0], abs=1e-9)


HOLD = """
import sys
from isotruss_ros.demo import domains
domains.LOCK_NAME = sys.argv[2].replace('@', chr(0))
lock = domains.lock_domain(int(sys.argv[1]))
print(lock.number, flush=True)
sys.stdin.read()
"""


def test_a_domain_locked_by_another_process_is_skipped_until_the_process_is_killed(monkeypatch):
    # The locks of the runs on this machine are left alone.
    name = f'isotruss_ros_test_{os.getpid()}_{{}}'
    monkeypatch.setattr(domains, 'LOCK_NAME', '\0' + name)
    command = [sys.executable, '-c', HOLD, '40', '@' + name]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert int(process.stdout.readline()) == 40
        with contextlib.closing(domains.lock_domain(40)) as own:
            assert own.number == 41
        process.kill()
        process.wait()
        with contextlib.closing(domains.lock_domain(40)) as own:
            assert own.number == 40
