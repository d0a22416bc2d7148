# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The live view in a browser; it reads messages by their fields.

Entry points: `view.View`, `picture.Picture`, `recording.read_recording`.
Imports `core` and viser, no ROS.
"""
