# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Nodes for the bring-up of a robot: checks before its first motion, and calibration.

Entry points: `preflight`, `check_rollers`, `calibration`, `pluck`. They read the measured joints
by `joint_markers`. Imports `nodes.framework`, `calibration` and the core.
"""
