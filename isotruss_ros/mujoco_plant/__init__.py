# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
MuJoCo plant: simulation of robots with rollers and objects in MuJoCo.

Entry points: `plant.MujocoPlant`, `mjcf`, `driven_robot.DrivenRobot`.
Imports `core` and MuJoCo.
"""
