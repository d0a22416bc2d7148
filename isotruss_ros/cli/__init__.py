# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Commands that need no ROS.

Entry points: `main` of each module, as setup.py names them.
Imports `core`, `calibration`, `mujoco_plant`, `plotting` and `viewer`.
"""
