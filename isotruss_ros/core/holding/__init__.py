# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Statics of a free object: equilibrium between grasping members, and slip margin.

Entry points: `settle_grasp.settle_grasp`, `attach_grip`, `roll_grip`, `grasp_gradient`.
Imports `core.contact`, `core.manipulation` and the layers below them.
"""
