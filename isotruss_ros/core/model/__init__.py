# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Models of robot and object: robot files, presets, topology, shapes, poses.

Entry points: `robot_file.read_robot_file`, `convex_object.ConvexObject`, `shapes`, `pose.Pose`.
Imports `core.numerics`.
"""
