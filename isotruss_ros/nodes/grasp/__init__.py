# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The analysis of the measured grasp: when inputs allow it, and the codes by which it is reported.

Entry points: `grasp_monitor.GraspMonitor`, `grasp_report.GraspReport`. Imports the core, no ROS.
"""
