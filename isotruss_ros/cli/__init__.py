# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Commands for the terminal, of which only `operate` needs ROS.

Entry points: `main` of each module, listed in setup.py.
Imports `core`, `calibration`, `mujoco_plant`, `plotting` and `viewer`.
"""
