# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tolerances of a roller trajectory, with the meaning of control_msgs/FollowJointTrajectory."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from isotruss_ros.core.control.inputs import RollerState
from isotruss_ros.core.numerics.arrays import Array
import numpy as np


class Tolerance(NamedTuple):
    """
    Largest deviation of measured rollers from where they should be; infinite where unbounded.

    :ivar positions: (r,) [m].
    :ivar velocities: (r,) [m/s].
    """

    positions: Array
    velocities: Array

    def find_violation(
        self, names: Sequence[str], wanted: RollerState, measured: RollerState
    ) -> str:
        """
        Return which roller deviates by how much, in words; empty where none does.

        :param names: of the rollers.
        :param wanted: where they should be.
        :param measured: where they are.
        """
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
    """
    What a goal allows.

    :ivar path: along the trajectory; None for no bound: the trajectory waits for its rollers.
    :ivar goal: at its end; None for that of the servo.
    :ivar goal_time: how much later than planned the end may be reached, infinite without bound
        [s]; None for that of the servo.
    """

    path: Tolerance | None = None
    goal: Tolerance | None = None
    goal_time: float | None = None
