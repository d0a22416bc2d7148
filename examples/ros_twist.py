# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Move the held object up by 2 cm: publish twists until its pose says so.

First: `ros2 launch isotruss_ros simulation.launch.py`, or your robot and `manipulation`.
"""

from geometry_msgs.msg import PoseStamped, Twist
import rclpy

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

while not heights or heights[-1] - heights[0] < 0.02:
    rclpy.spin_once(node)
twists.publish(Twist())  # stop now, not after command_timeout
print(f'the object moved up by {1000 * (heights[-1] - heights[0]):.1f} mm')
node.destroy_node()
rclpy.shutdown()
