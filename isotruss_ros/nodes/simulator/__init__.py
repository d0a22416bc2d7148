# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The node `simulator`: stands for a robot and its object.

Entry point: `node`. Beside it are the object on each plant, the robot in MuJoCo, the sensors, and
the truth and the time that it publishes. Imports `nodes.framework`, `mujoco_plant` and the core.
"""
