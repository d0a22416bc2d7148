# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The simulated robot and the object that it grasps.

Entry points: `simulated_robot.SimulatedRobot`, `rigid_object`, `elastic_object`.
Imports `core.safety` and what is below it.
"""
