# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Live view in a browser, which shows messages of ROS or of recordings.

Entry points: `view.View`, `picture.Picture`, `recording.read_recording`.
Imports `core` and viser, no ROS.
"""
