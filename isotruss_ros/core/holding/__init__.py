# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A free object: its equilibrium between grasping members, and its slip margin.

Entry points: `settle_grasp.settle_grasp`, `attach_grip`, `roll_grip`, `grasp_gradient`.
Imports `core.contact`, `core.manipulation` and what is below them.
"""
