# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Publish messages once, each by a new process, as `ros2 topic pub --once` does.

Reads a topic and `latched` or `volatile` from each line of its input, and prints a line when the
process has left. It has imported all that the processes need, so that they begin at once.
"""

from __future__ import annotations

import os
import sys
import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Bool
from trajectory_msgs.msg import JointTrajectory

LEAVE = 0.1
#: What is published; the name of a roller that there is not halts until another message comes.
MESSAGES = {
    'emergency_stop': Bool(data=True),
    'failed_rollers': DiagnosticArray(
        status=[DiagnosticStatus(name='nobody', level=DiagnosticStatus.ERROR)]
    ),
    'joint_trajectory_controller/joint_trajectory': JointTrajectory(),
}


def publish_once(topic: str, durability: DurabilityPolicy) -> None:
    """
    Publish one message after the first match, and leave.

    :param topic: its name.
    :param durability: whether late joiners receive it too.
    """
    rclpy.init()
    node = rclpy.create_node('button', start_parameter_services=False)
    message = MESSAGES[topic]
    profile = QoSProfile(depth=1, durability=durability)
    publisher = node.create_publisher(type(message), topic, profile)
    while publisher.get_subscription_count() == 0:
        time.sleep(0.001)
    publisher.publish(message)
    time.sleep(LEAVE)
    node.destroy_node()
    rclpy.shutdown()


def main() -> None:
    """Publish as often as there are lines."""
    kinds = {
        'latched': DurabilityPolicy.TRANSIENT_LOCAL,
        'volatile': DurabilityPolicy.VOLATILE,
    }
    for line in sys.stdin:
        topic, kind = line.split()
        process = os.fork()
        if process == 0:
            publish_once(topic, kinds[kind])
            os._exit(0)
        os.waitpid(process, 0)
        print('left', flush=True)


if __name__ == '__main__':
    main()
