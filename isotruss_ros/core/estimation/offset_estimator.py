# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Roller offsets from messages of joint markers: gates, filter, and detection of slip."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from isotruss_ros.core.estimation.marker_gate import find_swap, judge_markers
from isotruss_ros.core.estimation.offset_filter import OffsetFilter
from isotruss_ros.core.estimation.slip_watch import SlipWatch
from isotruss_ros.core.estimation.state_estimate import EstimatorSettings
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Number of successive messages without a consistent marker after which the roller offsets are
#: regarded as unknown [-].
MAX_INCONSISTENT_MESSAGES = 5


class OffsetEstimator(OffsetFilter):
    """
    Filter of the roller offsets that rejects inconsistent markers.

    :ivar used: sorted names of the joints whose last marker was accepted; `left_out` and `swapped`
        as in `StateEstimate`.
    """

    def __init__(self, robot: Robot, settings: EstimatorSettings) -> None:
        super().__init__(robot, settings)
        self._names, self._rollers = robot.topology.joint_names, robot.roller_names
        self._slips, self._inconsistent = SlipWatch(len(self._rollers)), 0
        self.used: tuple[str, ...] = ()
        self.left_out: tuple[str, ...] = ()
        self.swapped: tuple[str, ...] = ()

    @property
    def slipping(self) -> tuple[str, ...]:
        """Return the names of the slipping rollers."""
        flags = zip(self._rollers, self._slips.slipping, strict=True)
        return tuple(name for name, slips in flags if slips)

    def take_markers(
        self,
        time: float,
        markers: Mapping[str, tuple[float, float]],
        deviation: float,
        readings: tuple[Array, Array],
        place: Callable[[Array], tuple[Array, Array]],
    ) -> bool:
        """
        Update the offsets with a message of markers; return whether at least one was used.

        :param readings: (r,) encoder readings at that time [m], and (n, r) all stored ones.
        :param place: function that returns joint positions for offsets, see `update`.
        """
        now, stored = readings
        rows = np.array([2 * self._names.index(name) + i for name in markers for i in (0, 1)])
        values, rates = place(self.offsets)
        expected, slopes = self.expect(values, rates, rows, self.mean)
        measured = np.array(list(markers.values()), dtype=float).ravel()
        encoders = self._settings.encoders**2 * rates[rows] @ rates[rows].T
        noise = deviation**2 * np.eye(len(rows)) + encoders
        covariance = slopes @ self.covariance @ slopes.T + noise
        pairs, expected = measured.reshape(-1, 2), expected.reshape(-1, 2)
        reach = np.ptp(stored, axis=0)
        used, slipped = judge_markers(pairs - expected, covariance, rates[rows], reach)
        self.inflate(slipped**2)
        names = np.array(list(markers))
        self.used = tuple(sorted(names[used].tolist()))
        self.left_out = tuple(sorted(names[~used].tolist()))
        swapped = find_swap(pairs, expected, covariance) if self.left_out else None
        self.swapped = () if swapped is None else tuple(sorted(names[list(swapped)].tolist()))
        self._inconsistent = 0 if self.used or self.swapped else self._inconsistent + 1
        if self._inconsistent >= MAX_INCONSISTENT_MESSAGES:  # e.g. after a restart of the encoders
            self.inflate(np.full_like(now, np.inf))
            self._inconsistent = 0
        chosen = np.flatnonzero(np.repeat(used, 2))
        if not len(chosen):
            return False
        self.update(measured[chosen], noise[np.ix_(chosen, chosen)], rows[chosen], place)
        variances = np.diag(self.offset_covariance) + self._settings.joint_error**2
        self._slips.add(time, now, self.offsets, variances)
        return True
