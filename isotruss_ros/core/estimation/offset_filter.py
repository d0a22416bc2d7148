# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Zeros of the rollers by markers on joints: an iterated Kalman filter."""

from __future__ import annotations

from collections.abc import Callable

from isotruss_ros.core.estimation.belief import Belief, Expectation, update_belief
from isotruss_ros.core.estimation.state_estimate import EstimatorSettings
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.numerics.arrays import Array, Indices
import numpy as np

#: Slips are drawn anew over each such piece of travel [m].
SLIP_LENGTH = 0.1
#: Deviation of zeros that no marker fits any more, such as after the encoders began anew, and the
#: largest one there is [m].
UNKNOWN_ZEROS = 0.05


class OffsetFilter:
    """
    Gaussian belief of x = (dphi, c, m): offsets, and what is constant of the markers.

    dphi are the offsets of the r rollers [m], c the common shift of all markers (x, y) [m] and
    their turn about the middle of the joints [rad], m where each is mounted against its joint [m].

    :ivar belief: of the state.
    :param robot: with its zeros as far as they are known.
    :param settings: what else is known of it.
    """

    def __init__(self, robot: Robot, settings: EstimatorSettings) -> None:
        self._settings, self._count = settings, len(robot.roller_names)
        joints = len(robot.topology.joint_names)
        places = robot.home.nodes[:joints]
        lever = (places - places.mean(axis=0)) @ [[0.0, 1.0], [-1.0, 0.0]]
        shift = np.tile(np.eye(2), (joints, 1))
        #: Derivatives of all markers by what is constant of them.
        self._constant = np.column_stack([shift, lever.ravel(), np.eye(2 * joints)])
        sizes = settings.marker_shift, settings.marker_turn, settings.joint_error
        variances = np.repeat([settings.zeros, *sizes], [self._count, 2, 1, 2 * joints]) ** 2
        self.belief = Belief(np.zeros(len(variances)), np.diag(variances))

    @property
    def offsets(self) -> Array:
        """Return the mean of the offsets, (r,) [m]."""
        return self.belief.mean[: self._count]

    @property
    def covariance(self) -> Array:
        """Return the (r, r) covariance of the offsets [m^2]."""
        return self.belief.covariance[: self._count, : self._count]

    def predict(self, elapsed: float, travel: Array) -> None:
        """
        Propagate the covariance by process noise.

        :param elapsed: [s].
        :param travel: (r,) of the rollers since, not negative [m].
        """
        given = self._settings
        self.inflate(given.slip**2 * SLIP_LENGTH * travel + given.drift**2 * elapsed)

    def inflate(self, variances: Array) -> None:
        """
        Add to the variances of the offsets, up to that of unknown zeros.

        :param variances: (r,) [m^2].
        """
        covariance = self.belief.covariance.copy()
        own = np.arange(self._count)
        most = np.maximum(UNKNOWN_ZEROS**2 - covariance[own, own], 0.0)
        covariance[own, own] += np.minimum(variances, most)
        self.belief = Belief(self.belief.mean, covariance)

    def forget(self) -> None:
        """Take the zeros for unknown."""
        self.inflate(np.full(self._count, UNKNOWN_ZEROS**2))

    def expect(
        self, values: Array, rates: Array, rows: Indices, mean: Array | None = None
    ) -> Expectation:
        """
        Return where markers are expected.

        :param values: (2j,) where the joints are, x0, y0, x1, y1, ... [m].
        :param rates: (2j, r) derivatives by the offsets.
        :param rows: (m,) numbers of the coordinates that are measured.
        :param mean: (n,) state in which that is; the believed one if None.
        """
        constant = self._constant[rows]
        mean = self.belief.mean if mean is None else mean
        expected = values[rows] + constant @ mean[self._count :]  # noqa: E203
        return Expectation(expected, np.hstack([rates[rows], constant]))

    def update(
        self,
        measured: Array,
        noise: Array,
        rows: Indices,
        joints: Callable[[Array], tuple[Array, Array]],
    ) -> None:
        """
        Take markers in.

        :param measured: (m,) coordinates [m].
        :param noise: (m, m) covariance of their noise [m^2].
        :param rows: (m,) numbers of these coordinates.
        :param joints: returns values and rates, see `expect`, for offsets (r,).
        """

        def expect(mean: Array) -> Expectation:
            return self.expect(*joints(mean[: self._count]), rows, mean)

        self.belief = update_belief(self.belief, measured, noise, expect)
