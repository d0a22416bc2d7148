# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tolerances of a roller trajectory, as defined in control_msgs/FollowJointTrajectory."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from isotruss_ros.core.inputs import RollerState
from isotruss_ros.core.numerics.arrays import Array
import numpy as np


class Tolerance(NamedTuple):
    """Largest deviations of measured from desired roller states; infinite if not bounded."""

    positions: Array  #: (r,) deviations of positions [m]
    velocities: Array  #: (r,) deviations of velocities [m/s]

    def find_violation(
        self, names: Sequence[str], wanted: RollerState, measured: RollerState
    ) -> str:
        """Return a sentence about the roller farthest beyond its tolerance; empty if none."""
        for what, unit, bounds, off in (
            ('', 'm', self.positions, wanted.positions - measured.positions),
            (' in speed', 'm/s', self.velocities, wanted.velocities - measured.velocities),
        ):
            beyond = np.abs(off) - bounds
            worst = int(beyond.argmax())
            if beyond[worst] > 0.0:
                return (
                    f'roller {names[worst]} is {abs(off[worst]):.4g} {unit} off{what}; the goal '
                    f'allows {bounds[worst]:g} {unit}'
                )
        return ''


class TrajectoryTolerances(NamedTuple):
    """Tolerances that the goal of a trajectory action prescribes."""

    #: tolerance along the trajectory; None: no bound, and trajectory time stops while a roller
    #: lags behind
    path: Tolerance | None = None
    goal: Tolerance | None = None  #: tolerance at the end; None: the default of the servo
    #: largest delay of arrival [s], infinite if not bounded; None: the servo's default
    goal_time: float | None = None
