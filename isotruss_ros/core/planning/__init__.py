# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The search for grasps, for the motion that closes them, and for the release.

Entry points: `plan_grasps.plan_grasps`, `foresee_path`, `reach_pose`, `release`.
Imports `core.safety` and what is below it, not the servo.
"""
