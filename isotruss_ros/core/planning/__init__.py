# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Planning: search for grasps, closing motions, feasibility of paths, and release.

Entry points: `plan_grasps.plan_grasps`, `foresee_path`, `reach_pose`, `release`.
Imports `core.paths`, `core.safety` and the layers below them, not the servo or estimation.
"""
