# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Monitoring of the measured grasp: it is analysed while inputs are valid, and reported with codes.

Entry points: `grasp_monitor.GraspMonitor`, `grasp_report.GraspReport`. Imports the core, no ROS.
"""
