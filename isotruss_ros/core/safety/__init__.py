# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Distances, barriers and failed rollers: what keeps a motion safe.

Entry points: `shape_guard.ShapeGuard`, `barriers`, `roller_failure.FailureDetector`.
Imports `core.holding` and what is below it.
"""
