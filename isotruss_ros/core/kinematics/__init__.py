# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Kinematics: node positions as a function of roller travel, equations (3), (12) and (13).

Entry points: `robot.Robot`, `configuration.Configuration`, `rigidity`.
Imports `core.model` and the layers below it.
"""
