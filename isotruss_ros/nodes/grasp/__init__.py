# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Monitoring of a measured grasp, which is analysed while inputs are valid.

Entry points: `grasp_monitor.GraspMonitor`, `grasp_report.GraspReport`. Imports the core, no ROS.
"""
