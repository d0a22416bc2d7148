# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Simulated robots with grasped objects.

Entry points: `simulated_robot.SimulatedRobot`, `rigid_object`, `elastic_object`.
Imports `core.safety` and the layers below it.
"""
