# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Safety of motions by clearances, control barrier functions and detection of failed rollers.

Entry points: `shape_guard.ShapeGuard`, `barriers`, `roller_failure.FailureDetector`.
Imports `core.holding` and the layers below it.
"""
