# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Twists for `manipulation`, of the type that it is set to receive."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from geometry_msgs.msg import Twist, TwistStamped
from isotruss_ros.nodes.conversions.messages import stamp_header, to_twist_message
from isotruss_ros.nodes.framework.qos import RELIABLE
from rclpy.node import Node


def create_twist_publisher(
    node: Node, stamped: bool, frame: str
) -> Callable[[Sequence[float]], None]:
    """
    Return what publishes a twist (vx, vy, omega) [m/s, rad/s] on `cmd_vel`.

    :param node: publishes; a managed one only while it is active.
    :param stamped: whether as TwistStamped, not as Twist.
    :param frame: of a TwistStamped.
    """
    create = getattr(node, 'create_lifecycle_publisher', node.create_publisher)
    publisher = create(TwistStamped if stamped else Twist, 'cmd_vel', RELIABLE)

    def publish(twist: Sequence[float]) -> None:
        message = to_twist_message(twist)
        if stamped:
            message = TwistStamped(twist=message)
            stamp_header(message.header, node.get_clock().now(), frame)
        publisher.publish(message)

    return publish
