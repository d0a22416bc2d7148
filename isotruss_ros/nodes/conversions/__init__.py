# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Conversion of messages to values of the core and back, with checks of external input.

Entry points: `read_...` raise MessageError, `to_...` return messages. Imports `nodes.grasp`, the
core and message packages, no `rclpy` node.
"""
