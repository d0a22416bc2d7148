# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Node `simulator`, which replaces a robot and its object.

Entry point: `node`. Other modules: the object of each plant, the robot in MuJoCo, sensors, true
states and simulated time. Imports `nodes.framework`, `mujoco_plant` and the core.
"""
