# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Print the state of the grasp: one message of `grasp/state`.

First: `ros2 launch isotruss_ros simulation.launch.py indentation:=0.005`, or your robot and
`grasp_analysis`.
"""

import sys

from isotruss_ros.extras import explained_imports

with explained_imports():
    from isotruss_msgs.msg import GraspState
    import rclpy
    from rclpy.wait_for_message import wait_for_message

TIMEOUT = 20.0  # [s]
rclpy.init()
node = rclpy.create_node('ros_grasp_state')
received, state = wait_for_message(GraspState, node, 'grasp/state', time_to_wait=TIMEOUT)
if not received:
    sys.exit(f'nothing on grasp/state in {TIMEOUT:g} s: is grasp_analysis active?')
if state.code > GraspState.WRINKLED:
    sys.exit(f'no result: {state.message}')
for contact in state.contacts:
    at = contact.position
    print(f'{contact.normal_force:.2f} N at x {at.x:.3f} m, y {at.y:.3f} m')
print('held:', state.held == state.HELD_YES, '- force closure:', state.force_closure)
node.destroy_node()
rclpy.shutdown()
