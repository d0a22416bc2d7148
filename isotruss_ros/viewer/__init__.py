# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The live view in a browser; it reads messages by their fields and imports no ROS."""
