# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
MuJoCo plant: export of robot files as models, driven by rollers.

Entry points: `plant.MujocoPlant`, `mjcf`, `driven_robot.DrivenRobot`.
Imports `core` and MuJoCo.
"""
