# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Loops that command the robot: inputs, twist servo, path tracking, roller trajectories.

Entry points: `twist_servo.TwistServo`, `path_servo.PathServo`, `state_estimator.StateEstimator`.
Imports `core.safety` and what is below it.
"""
