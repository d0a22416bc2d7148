# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Move the held object up by 2 cm by twists, until the measured pose is reached.

First: `ros2 launch isotruss_ros simulation.launch.py`, or your robot and `manipulation`.
"""

import sys
import time

from isotruss_ros.extras import explained_imports

with explained_imports():
    from geometry_msgs.msg import PoseStamped, Twist
    import rclpy

TIMEOUT = 20.0  # [s]
rclpy.init()
node = rclpy.create_node('ros_twist')
twists = node.create_publisher(Twist, 'cmd_vel', 1)
heights = []
node.create_subscription(
    PoseStamped, 'object_pose', lambda message: heights.append(message.pose.position.y), 1
)
up = Twist()
up.linear.y = 0.02  # [m/s]
node.create_timer(0.02, lambda: twists.publish(up))  # quicker than command_timeout

end = time.monotonic() + TIMEOUT
while not heights or heights[-1] - heights[0] < 0.02:
    rclpy.spin_once(node, timeout_sec=0.1)
    if time.monotonic() > end:
        twists.publish(Twist())
        words = f'moved up by {1000 * (heights[-1] - heights[0]):.1f} mm' if heights else 'unknown'
        sys.exit(f'object pose: {words} in {TIMEOUT:g} s; must be 20 mm: see manipulation/status')
twists.publish(Twist())  # stop now, not after command_timeout
print(f'the object moved up by {1000 * (heights[-1] - heights[0]):.1f} mm')
node.destroy_node()
rclpy.shutdown()
