# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Estimate the roller offsets from markers on three joints."""

from isotruss_ros import core
from isotruss_ros.core.estimation.state_estimate import EstimatorSettings
from isotruss_ros.core.estimation.state_estimator import StateEstimator
import numpy as np

robot = core.load_robot('nine_member')
true = robot.configuration([0.005] * 6)  # each encoder reads 5 mm less
joints = dict(zip(robot.topology.joint_names, true.nodes, strict=False))

# The frame of the tracker and the mounting of the markers have no errors.
settings = EstimatorSettings(marker_shift=0.0, marker_turn=0.0, joint_error=1e-4)
estimator = StateEstimator(robot, settings)
noise = np.random.default_rng(0)
for number in range(20):  # measured markers with a standard deviation of 1 mm
    time = 0.05 * number  # [s]
    estimator.take_encoders(time, [0.0] * 6)
    markers = {name: joints[name] + 1e-3 * noise.standard_normal(2) for name in 'QRZ'}
    estimator.take_markers(time, markers, 1e-3)
print('to be added:', (1e3 * estimator.estimate().offsets).round(1), 'mm')
