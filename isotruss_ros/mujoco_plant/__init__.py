# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The robot in MuJoCo: any robot file as a model, and a plant that rollers drive.

Entry points: `plant.MujocoPlant`, `mjcf`, `driven_robot.DrivenRobot`.
Imports `core` and MuJoCo.
"""
