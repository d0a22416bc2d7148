# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Peer of the nodes: an empty rclpy node that publishes commands and statuses at 200 Hz.

    python studies/benchmarks/peer.py TOPIC
"""

from __future__ import annotations

import contextlib
import sys

from isotruss_msgs.msg import ManipulationStatus
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray

#: Rate of the timer [Hz].
RATE = 200.0


def main() -> None:
    """Publish until the process is killed."""
    rclpy.init()
    node = Node('peer')
    commands = node.create_publisher(Float64MultiArray, sys.argv[1], 1)
    statuses = node.create_publisher(ManipulationStatus, 'peer/status', 1)
    command, status = Float64MultiArray(data=[0.0] * 6), ManipulationStatus()
    status.header.frame_id = 'truss'

    def publish() -> None:
        commands.publish(command)
        statuses.publish(status)

    node.create_timer(1.0 / RATE, publish)
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)


if __name__ == '__main__':
    main()
