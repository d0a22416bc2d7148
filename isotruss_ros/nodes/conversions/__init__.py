# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Conversion between messages and values of the core, with checks of messages.

Entry points: `read_...` raise MessageError, `to_...` return messages. Imports `nodes.grasp`, the
core and message packages, no `rclpy` node.
"""
