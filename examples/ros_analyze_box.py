# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Request the analysis of a box between two sides that do not meet.

First: `ros2 launch isotruss_ros simulation.launch.py`, or your robot and `grasp_analysis`.
"""

import math
import sys

from isotruss_ros.extras import explained_imports

with explained_imports():
    from geometry_msgs.msg import Point
    from isotruss_msgs.msg import ConvexObject
    from isotruss_msgs.srv import AnalyzeGrasp
    import rclpy

TIMEOUT = 20.0  # of each wait [s]
rclpy.init()
node = rclpy.create_node('ros_analyze_box')
corners = ((-0.25, -0.2), (0.25, -0.2), (0.25, 0.2), (-0.25, 0.2))  # in the box's own frame [m]
request = AnalyzeGrasp.Request(friction=0.9, roller_positions=[0.0] * 6)  # the robot at home
request.object.shape = ConvexObject.POLYGON
request.object.vertices = [Point(x=x, y=y) for x, y in corners]
request.object.corner_radii = [0.02]
pose, angle = request.object_pose, -0.5  # [rad]
pose.position.x, pose.position.y = 0.49, -0.28
pose.orientation.z, pose.orientation.w = math.sin(0.5 * angle), math.cos(0.5 * angle)

client = node.create_client(AnalyzeGrasp, 'analyze_grasp')
if not client.wait_for_service(TIMEOUT):
    sys.exit(f'no node offers analyze_grasp in {TIMEOUT:g} s: does grasp_analysis run?')
asked = client.call_async(request)
rclpy.spin_until_future_complete(node, asked, timeout_sec=TIMEOUT)
if not asked.done():
    sys.exit(f'analyze_grasp has not responded in {TIMEOUT:g} s')
answer = asked.result()
if not answer.success:
    sys.exit(f'no result: {answer.message}')
for member, force in zip(answer.state.grasping_members, answer.state.squeeze, strict=True):
    print(f'{member} would press with {force:.1f} N')
held = answer.state.held == answer.state.HELD_YES
print('held:', held, answer.message, answer.state.hold_message)
node.destroy_node()
rclpy.shutdown()
