# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Node `simulator`, which takes the place of a robot and its object.

Entry point: `node`. Its other modules contain the plants, the sensors, the true states and the
simulated time. Imports `nodes.framework`, `mujoco_plant` and the core.
"""
