# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Conversion between ROS messages and values of the core; received messages are checked.

Entry points: functions `read_...`, which raise MessageError, and `to_...`, which return messages.
Imports `nodes.grasp`, the core and message packages, no `rclpy` node.
"""
