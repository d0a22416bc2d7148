# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Detection of failed rollers, which do not move for a given time although they are commanded.

The range (maximum minus minimum) of the commanded travel is compared with that of the measured
travel. So delays, oscillating commands, and noise without drift do not lead to false detections.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
import math

from isotruss_ros.core.model.topology import check_names
from isotruss_ros.core.numerics.arrays import Array, Flags
from isotruss_ros.core.numerics.records import replace
import numpy as np

#: A commanded roller that does not move for this time has failed [s].
FAILURE_TIME = 1.0
#: Smallest commanded speed that counts as a command [m/s]; at lower speeds a roller may stick.
MIN_SPEED = 0.002
#: Smallest ratio of measured to commanded range of a working roller [-].
MIN_SHARE = 0.25
#: Largest delay between a command and the roller's motion [s].
SETTLING_TIME = 0.2
#: Commanded range after which a roller with sufficient measured range counts as working [m].
EVIDENT_TRAVEL = 0.02


@dataclass(frozen=True, eq=False)
class FailureDetector:
    """
    Detector of failed rollers, which compares commanded with measured travel.

    A failed roller is reported until it is reset, because a roller at rest cannot prove that it
    works.

    :ivar names: names of the r rollers.
    :ivar failure_time: a commanded roller that does not move for this time has failed [s].
    :ivar failed: names of the failed rollers.
    :ivar time: time of the last measured travel [s]; NaN before the first.
    :ivar commanded: (r,) commanded travel [m].
    :ivar duration: (r,) time with a command since the last restart [s].
    :ivar path: (r,) commanded path length in that time [m].
    :ivar required: (r,) commanded range with which the measured range is compared after the
        settling time [m]; NaN: none.
    :ivar required_at: (r,) time at which it was set [s].
    :ivar minimum: (2, r) minimum of commanded and measured travel since the last restart [m].
    :ivar maximum: (2, r) the maximum [m].
    """

    names: tuple[str, ...]
    failure_time: float
    failed: frozenset[str]
    time: float
    commanded: Array
    duration: Array
    path: Array
    required: Array
    required_at: Array
    minimum: Array
    maximum: Array

    @classmethod
    def of(cls, names: Sequence[str], failure_time: float = FAILURE_TIME) -> FailureDetector:
        """Return the detector of working rollers."""
        zeros, none = np.zeros(len(names)), np.full(len(names), np.nan)
        travel = np.zeros((2, len(names)))
        start = zeros, zeros, zeros, none, none, travel, travel
        return cls(tuple(names), failure_time, frozenset(), math.nan, *start)

    def reset(self, names: Collection[str] | None = None) -> FailureDetector:
        """Return the detector after some or all rollers work again; all comparisons restart."""
        cleared = frozenset(self.names if names is None else names)
        check_names('rollers', cleared, self.names)
        return replace(self, failed=self.failed - cleared, time=math.nan)

    def updated(self, positions: Array, time: float, speeds: Array) -> FailureDetector:
        """Return the detector after travel (r,) [m], with the mean commanded speeds since then."""
        elapsed = time - self.time
        if elapsed == 0.0:
            return self
        # After samples that are out of order or far apart, the comparison restarts.
        if not 0.0 < elapsed <= FAILURE_TIME:
            travel = np.array([self.commanded, positions])
            return replace(self, time=time)._restarted(np.ones(len(self.names), bool), travel)
        # Commanded path, and ranges of commanded and measured travel since the restart.
        has_command = np.abs(speeds) >= MIN_SPEED
        step = elapsed * np.where(has_command, speeds, 0.0)
        commanded, path = self.commanded + step, self.path + np.abs(step)
        duration = self.duration + elapsed * has_command
        travel = np.array([commanded, positions])
        minimum, maximum = np.minimum(self.minimum, travel), np.maximum(self.maximum, travel)
        commanded_range, measured_range = maximum - minimum
        # The present commanded range is compared with the measured one after the settling time.
        # Drives cannot follow oscillations that are faster than this time.
        is_slow = commanded_range * duration >= 0.5 * SETTLING_TIME * path
        is_far = commanded_range >= MIN_SPEED * FAILURE_TIME
        is_long = duration >= self.failure_time - SETTLING_TIME
        is_new = is_slow & is_far & is_long & np.isnan(self.required_at)
        required = np.where(is_new, commanded_range, self.required)
        required_at = np.where(is_new, time, self.required_at)
        # Failed rollers, and those that evidently work; the comparison restarts for both.
        is_settled = time - required_at >= SETTLING_TIME
        is_due = is_settled & (duration >= self.failure_time)
        is_stuck = is_due & (measured_range < MIN_SHARE * required)
        failed = self.failed | {self.names[i] for i in np.flatnonzero(is_stuck)}
        follows = measured_range >= MIN_SHARE * commanded_range
        compared = commanded, duration, path, required, required_at, minimum, maximum
        detector = FailureDetector(self.names, self.failure_time, failed, time, *compared)
        is_ended = is_due | (follows & (commanded_range >= EVIDENT_TRAVEL))
        return detector._restarted(is_ended, travel) if is_ended.any() else detector

    def _restarted(self, rollers: Flags, travel: Array) -> FailureDetector:
        """Return the detector with some comparisons restarted at a travel (2, r) [m]."""
        return replace(
            self,
            duration=np.where(rollers, 0.0, self.duration),
            path=np.where(rollers, 0.0, self.path),
            required_at=np.where(rollers, np.nan, self.required_at),
            minimum=np.where(rollers, travel, self.minimum),
            maximum=np.where(rollers, travel, self.maximum),
        )
