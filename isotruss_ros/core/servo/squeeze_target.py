# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Settings of the squeeze control."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SqueezeSettings:
    """
    Desired squeeze and settings of its control.

    :ivar force: mean normal force of the grasping members, positive [N].
    :ivar pose_gain: of the pose, from which the others follow; None for that of the frequency, see
        `choose_gain` [1/s].
    :ivar frequency: lowest natural frequency of the held object, measured; None to compute it from
        the masses [rad/s].
    :ivar max_utilisation: of the moment at which tubes wrinkle; commands that lead toward it are
        slowed, and beyond it only those that lead away are carried out [-].
    :ivar load: standard deviation of loads on the object; 0 for that of `EstimatorSettings` [N].
    :ivar zeros: standard deviation of the rollers' zeros, where no estimator says it [m].
    """

    force: float
    pose_gain: float | None = None
    frequency: float | None = None
    max_utilisation: float = 1.0
    load: float = 0.0
    zeros: float = 0.01
