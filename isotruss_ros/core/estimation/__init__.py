# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Estimation of roller offsets, object pose, squeeze and load from encoders, poses and markers.

Entry points: `state_estimator.StateEstimator`, `grip_belief.GripBelief`.
Imports `core.safety` and the layers below it, not `core.paths`, planning or the servo.
"""
