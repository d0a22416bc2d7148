# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What names the failed rollers over DDS: where a message may have been lost, nothing moves."""

from isotruss_ros.core import Status
from isotruss_ros.nodes.manipulation import Manipulation
from probe import overrides, ROBOT, world
import pytest
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import String

pytestmark = pytest.mark.system

FIRST = ROBOT.roller_names[0]
CASES = {
    ReliabilityPolicy.BEST_EFFORT: 'is best-effort',
    ReliabilityPolicy.RELIABLE: 'left before a message was received',
}


@pytest.mark.parametrize('reliability', CASES)
def test_halts_where_a_message_may_have_been_lost_until_there_is_another(reliability):
    # The joint states here are made up.
    with world(lambda: Manipulation(overrides(failure_time=0.0))) as w:
        w.until_code(Status.OK, w.probe.send_all)
        profile = QoSProfile(depth=1, reliability=reliability)
        publisher = w.probe.create_publisher(String, 'failed_rollers', profile)
        if reliability == ReliabilityPolicy.RELIABLE:
            w.until(lambda: publisher.get_subscription_count() == 1, w.probe.send_all)
            w.probe.destroy_publisher(publisher)
        status = w.until_code(Status.HALT_INVALID_FAILED_ROLLERS, w.probe.send_all)
        assert CASES[reliability] in status.message
        other = w.probe.create_publisher(String, 'failed_rollers', 10)
        w.until(lambda: other.get_subscription_count() == 1, w.probe.send_all)
        other.publish(String(data=FIRST))
        w.until(lambda: w.code() < Status.HALT_NO_TWIST, w.probe.send_all)
        assert list(w.probe.last('status').failed_rollers) == [FIRST]
