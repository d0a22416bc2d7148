# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Measured run of a held object: means of the measurements in intervals of time."""

from __future__ import annotations

from dataclasses import dataclass, replace

from isotruss_ros.core import Grip, Robot, Status
from isotruss_ros.core.errors import IsotrussError
from isotruss_ros.core.manipulation.status import GRIP_FAULTS
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.identification.gauge import Gauge
import numpy as np

#: Median absolute value of a normal distribution of unit variance [-].
NORMAL_MEDIAN = 0.6745
#: Smallest number of pressures for which a rise is fitted [-].
MIN_PRESSURES = 10
#: Time [s], status and message of a halt.
Halt = tuple[float, Status, str]


class RunError(IsotrussError, ValueError):
    """Error: a recorded run cannot be compared with the model."""


@dataclass(frozen=True, eq=False)
class MeasuredRun:
    """Means of the measurements in n intervals, until the control loop reports a slip."""

    robot: Robot
    grip: Grip  #: members, and object at its first measured pose
    friction: float  #: coefficient of friction in the settings; NaN: not recorded [-]
    times: Array  #: (n,) times on the clock of the run [s]
    travel: Array  #: (n, r) roller travel, with the offsets that the control loop knew [m]
    poses: Array  #: (n, 3) poses of the object [m, rad]
    deviations: Array  #: (n, 3) standard deviations of these means by noise [m, rad]
    squeeze: Array  #: (n,) squeeze of the gauge [N]; NaN without reading
    pull: Array  #: (n, 2) force of the gauge on the object [N]; zero without gauge
    gravity: Array  #: (n, 2) gravity in the plane of the robot [m/s^2]; zero without gauge
    #: mean and rise of the pressures relative to the robot file [-]; None: not recorded
    pressure: Array | None
    halts: tuple[Halt, ...]  #: halts that begin, slips included

    @property
    def slips(self) -> bool:
        """Return whether the control loop reported that the object slipped or was lost."""
        return any(status in GRIP_FAULTS for _, status, _ in self.halts)

    @property
    def members(self) -> Indices:
        """Return the indices of the grasping members, (m,)."""
        return np.array([self.robot.member_names.index(name) for name in self.grip.members])


@dataclass(frozen=True, eq=False)
class Samples:
    """Measurements by their stamps."""

    robot: Robot
    grip: Grip  #: members, and object at any pose
    friction: float  #: coefficient of friction in the settings; NaN: not recorded [-]
    times: Array  #: (k,) increasing stamps of the poses [s]
    poses: Array  #: (k, 3) poses with continuous angles [m, rad]
    travel: Array  #: (k, r) roller travel at these times [m]
    #: stamps (j,) [s] and gauge pressures (j, t) [Pa]; None: not recorded
    pressures: tuple[Array, Array] | None
    halts: tuple[Halt, ...]

    def between(self, begin: float, end: float) -> Samples:
        """Return the samples between two times [s]."""
        chosen, pressures = (self.times >= begin) & (self.times <= end), self.pressures
        if pressures is not None:
            among = (pressures[0] >= begin) & (pressures[0] <= end)
            pressures = (pressures[0][among], pressures[1][among]) if among.any() else None
        return replace(
            self,
            times=self.times[chosen],
            poses=self.poses[chosen],
            travel=self.travel[chosen],
            pressures=pressures,
            halts=tuple(halt for halt in self.halts if halt[0] >= begin),
        )

    def average(self, gauge: Gauge | None, count: int) -> MeasuredRun:
        """Return the means in at most `count` equal intervals of time that contain a pose."""
        times, poses = self.times, self.poses
        edges = np.linspace(times[0], times[-1], min(count, len(times)) + 1)
        places = np.clip(np.searchsorted(edges, times, side='right') - 1, 0, len(edges) - 2)
        _, places = np.unique(places, return_inverse=True)
        number = np.bincount(places)

        def mean(columns: Array) -> Array:
            return np.stack([np.bincount(places, c) / number for c in columns.T], axis=1)

        means, mean_poses = mean(times[:, None])[:, 0], mean(poses)
        # Second differences cancel the motion; their variance is six times that of the noise.
        spread = np.median(np.abs(np.diff(poses, n=2, axis=0)), axis=0) / NORMAL_MEDIAN
        squeeze, (pull, gravity) = np.full(len(means), np.nan), np.zeros((2, len(means), 2))
        if gauge is not None:
            gauge.check_overlap(times[0], times[-1])
            is_covered = (means >= gauge.times[0]) & (means <= gauge.times[-1])
            if gauge.squeeze is not None:
                measured = np.interp(means, gauge.times, gauge.squeeze)
                squeeze = np.where(is_covered, measured, np.nan)
            if gauge.pull is not None:
                pull = mean(interpolate(times, gauge.times, gauge.pull))
            if gauge.gravity is not None:
                gravity = mean(interpolate(times, gauge.times, gauge.gravity))
        return MeasuredRun(
            self.robot,
            replace(self.grip, body=self.grip.body.moved_to(mean_poses[0])),
            self.friction,
            means,
            mean(self.travel),
            mean_poses,
            spread / np.sqrt(6.0 * number[:, None]),
            squeeze,
            pull,
            gravity,
            _relative_pressure(self.robot, self.pressures, means),
            self.halts,
        )


def _relative_pressure(
    robot: Robot, pressures: tuple[Array, Array] | None, times: Array
) -> Array | None:
    """Return mean and rise of the pressures during the run relative to the robot file."""
    if pressures is None:
        return None
    at, measured = pressures
    relative = (measured / list(robot.description.pressures.values())).mean(axis=1) - 1.0
    share = (at - times[0]) / (times[-1] - times[0]) - 0.5
    rise = np.polyfit(share, relative, 1)[0] if len(at) >= MIN_PRESSURES else 0.0
    return np.array([relative.mean(), rise])


def interpolate(times: Array, at: Array, values: Array) -> Array:
    """Return columns of values, measured `at` increasing times, at other times."""
    return np.stack([np.interp(times, at, column) for column in values.T], axis=1)
