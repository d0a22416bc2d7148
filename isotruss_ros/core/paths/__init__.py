# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Timing and tracking of object paths and roller trajectories.

Entry points: `object_path.ObjectPath`, `path_servo.PathServo`, `roller_trajectory`.
Imports `core.safety` and the layers below it, not `core.estimation`, planning or the servo.
"""
