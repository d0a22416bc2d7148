# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A control cycle by simulated time."""

from types import SimpleNamespace

from isotruss_ros.nodes.framework.cycle import Cycle
from probe import begin_context
import rclpy
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock


def test_a_cycle_begins_with_the_time_that_waits_behind_other_messages():
    begin_context()
    node = rclpy.create_node('cycle', parameter_overrides=[Parameter('use_sim_time', value=True)])
    other, arrived, seen = rclpy.create_node('witness'), [], []
    other.create_subscription(Clock, '/clock', arrived.append, 10)
    node.values = SimpleNamespace(rate=100.0, command_timeout=1.0)
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
