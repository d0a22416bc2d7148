# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Direct stiffness method of the robot: equations (1), (2) and (4).

Entry points: `structure.deform`, `frame.Frame`, `tube_stiffness.MODELS`, `wrinkling`.
Imports `core.kinematics` and the layers below it.
"""
