# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Roller offsets from joint markers: gates, iterated Kalman filter, and detection of slip."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from isotruss_ros.core.estimation.marker_gate import find_swap, judge_markers, SlipWatch
from isotruss_ros.core.estimation.schmidt_filter import condition
from isotruss_ros.core.estimation.state_estimate import EstimatorSettings, SLIP_LENGTH
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.numerics.tolerances import MAX_SEARCH_STEPS
import numpy as np
import scipy

#: Probability with which a mean without other errors counts as improbable [-]. With a fifth, an
#: upright robot with three marked joints was noticed in two of three carries.
IMPROBABLE = 0.05
#: Largest standard deviation of an offset, for unknown offsets after a restart of the encoders
#: [m].
MAX_OFFSET_DEVIATION = 0.05
#: Number of successive messages without a consistent marker after which the roller offsets are
#: regarded as unknown [-].
MAX_INCONSISTENT_MESSAGES = 5
#: Measured positions (x, y) of joints by name [m].
Markers = Mapping[str, tuple[float, float]]
#: Function that returns the joint positions (2j,) [m] and their Jacobian for roller offsets (r,).
JointModel = Callable[[Array], tuple[Array, Array]]


class OffsetFilter:
    """
    Gaussian belief of roller offsets and constant marker errors, x = (dphi, c, m).

    dphi are the offsets of the r rollers [m]. c consists of the common shift (x, y) of all markers
    [m] and their common rotation about the origin of the robot frame [rad]. m are the mounting
    offsets of the markers from the joints [m]. Inconsistent markers are rejected.

    :ivar findings: names of joints and rollers by the fields `used`, `left_out`, `swapped` and
        `slipping` of `StateEstimate`, as far as there are any.
    """

    def __init__(self, robot: Robot, settings: EstimatorSettings) -> None:
        self._settings, self._count = settings, len(robot.roller_names)
        joints = len(robot.topology.joint_names)
        positions = robot.home.nodes[:joints]
        lever = positions @ [[0.0, 1.0], [-1.0, 0.0]]
        shift = np.tile(np.eye(2), (joints, 1))
        #: Jacobian of all marker positions with respect to the markers' constant errors.
        self._constant = np.column_stack([shift, lever.ravel(), np.eye(2 * joints)])
        sizes = settings.marker_shift, settings.marker_turn, settings.joint_error
        counts = self._count, 2, 1, 2 * joints
        variances = np.repeat([settings.zero_deviation, *sizes], counts) ** 2
        self.mean, self.covariance = np.zeros(len(variances)), np.diag(variances)
        self._prior, self._measured = variances, np.zeros(2 * joints, dtype=bool)
        self._names, self._rollers = robot.topology.joint_names, np.array(robot.roller_names)
        self._slips, self._inconsistent = SlipWatch(self._count), 0
        self.findings: dict[str, Any] = {}

    @property
    def offsets(self) -> Array:
        """Return the mean of the roller offsets, (r,) [m]."""
        return self.mean[: self._count]

    @property
    def offset_covariance(self) -> Array:
        """Return the covariance matrix of the roller offsets, (r, r) [m^2]."""
        covariance = self.covariance[: self._count, : self._count]
        unknown = MAX_OFFSET_DEVIATION if self.is_improbable else 0.0
        return covariance + unknown**2 * np.eye(self._count)

    @property
    def is_improbable(self) -> bool:
        """
        Return whether the mean is improbable for the prior, for example of an upright robot.

        Then the measured joints have errors that are not in the state.
        """
        free = self._prior > 0.0
        squared = (self.mean[free] ** 2 / self._prior[free]).sum()
        return bool(squared > scipy.special.chdtri(self._measured.sum(), IMPROBABLE))

    def predict(self, elapsed: float, travel: Array) -> None:
        """Propagate the covariance by process noise; `travel` (r,) is absolute [m]."""
        settings = self._settings
        self.inflate(settings.slip**2 * SLIP_LENGTH * travel + settings.drift**2 * elapsed)

    def inflate(self, variances: Array) -> None:
        """Increase the variances (r,) of the offsets, at most to that of unknown offsets [m^2]."""
        added, before = np.zeros(len(self._prior)), np.diag(self.covariance)[: self._count]
        room = np.maximum(MAX_OFFSET_DEVIATION**2 - before, 0.0)
        added[: self._count] = np.minimum(variances, room)
        self._prior, self.covariance = self._prior + added, self.covariance + np.diag(added)

    def expect(self, joints: JointModel, rows: Indices, mean: Array) -> tuple[Array, Array]:
        """Return coordinates (m,) of the markers in `rows`, and their Jacobian, at a state."""
        (offsets, errors), constant = np.split(mean, [self._count]), self._constant[rows]
        values, rates = joints(offsets)
        return values[rows] + constant @ errors, np.hstack([rates[rows], constant])

    def update(self, measured: Array, noise: Array, rows: Indices, joints: JointModel) -> None:
        """Update the state with coordinates (m,) in `rows` by Gauss-Newton steps."""
        prior = mean = self.mean
        covariance = self.covariance
        for _ in range(MAX_SEARCH_STEPS):
            values, rates = self.expect(joints, rows, mean)
            gain, _, covariance = condition(self.covariance, rates, noise)
            moved = prior + gain @ (measured - values - rates @ (prior - mean))
            change, mean = np.abs(moved - mean), moved
            if (change <= np.sqrt(np.diag(covariance))).all():
                break
        self.mean, self.covariance = mean, covariance
        self._measured[rows] = True

    def take_markers(
        self,
        time: float,
        markers: Markers,
        deviation: float,
        readings: Array,
        reach: Array,
        joints: JointModel,
    ) -> bool:
        """
        Update the offsets with a message of markers; return whether at least one was used.

        The encoder readings (r,) are those at that time, `reach` (r,) is the range of the stored
        ones [m].
        """
        rows = np.array([2 * self._names.index(name) + i for name in markers for i in (0, 1)])
        expected, slopes = self.expect(joints, rows, self.mean)
        rates = slopes[:, : self._count]
        measured = np.array(list(markers.values()), dtype=float).ravel()
        encoders = self._settings.encoders**2 * rates @ rates.T
        noise = deviation**2 * np.eye(len(rows)) + encoders
        covariance = slopes @ self.covariance @ slopes.T + noise
        pairs, expected = measured.reshape(-1, 2), expected.reshape(-1, 2)
        used, slipped = judge_markers(pairs - expected, covariance, rates, reach)
        self.inflate(slipped**2)
        names = np.array(list(markers))
        swapped = None if used.all() else find_swap(pairs, expected, covariance)
        swapped_names = () if swapped is None else names[list(swapped)].tolist()
        self.findings['used'] = tuple(sorted(names[used].tolist()))
        self.findings['left_out'] = tuple(sorted(names[~used].tolist()))
        self.findings['swapped'] = tuple(sorted(swapped_names))
        self._inconsistent = 0 if used.any() or swapped_names else self._inconsistent + 1
        if self._inconsistent >= MAX_INCONSISTENT_MESSAGES:  # e.g. after a restart of the encoders
            self.inflate(np.full(self._count, np.inf))
            self._inconsistent = 0
        chosen = np.flatnonzero(np.repeat(used, 2))
        if not len(chosen):
            return False
        self.update(measured[chosen], noise[np.ix_(chosen, chosen)], rows[chosen], joints)
        variances = np.diag(self.offset_covariance) + self._settings.joint_error**2
        self._slips.add(time, readings, self.offsets, variances)
        self.findings['slipping'] = tuple(self._rollers[self._slips.slipping].tolist())
        return True
