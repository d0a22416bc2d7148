# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trajectories of the rollers of the preset, as messages."""

import math

from builtin_interfaces.msg import Duration
import numpy as np
from probe import N, ROBOT
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

NAMES = list(ROBOT.roller_names)
HOME = np.zeros(N)
AWAY = np.array([0.02, -0.01, 0.0, 0.015, 0.01, -0.02])
TOPIC = 'joint_trajectory_controller/joint_trajectory'


def lasting(seconds):
    sec = math.floor(seconds)
    return Duration(sec=sec, nanosec=round(1e9 * (seconds - sec)))


def trajectory(*rows, times=None, names=NAMES):
    """Return a trajectory; 0.4 s from row to row unless told otherwise."""
    times = 0.4 * np.arange(len(rows)) if times is None else times
    points = [
        JointTrajectoryPoint(positions=[float(v) for v in row], time_from_start=lasting(when))
        for row, when in zip(rows, times, strict=True)
    ]
    return JointTrajectory(joint_names=list(names), points=points)
