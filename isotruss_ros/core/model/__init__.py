# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a robot is: the robot file, the presets, the topology, objects."""
