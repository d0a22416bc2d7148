# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Home, stiffness and tube laws of a real robot, fitted to measurements.

Entry points: `home.calibrate_home`, `stiffness_scale`, `analysis.analyse`, `roller_check`.
Imports `core`.
"""
