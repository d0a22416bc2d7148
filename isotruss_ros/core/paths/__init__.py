# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Paths of the object and trajectories of the rollers: their timing, and the loops along them.

Entry points: `object_path.ObjectPath`, `path_servo.PathServo`, `roller_trajectory`.
Imports `core.safety` and what is below it, not `core.estimation`, planning or the servo.
"""
