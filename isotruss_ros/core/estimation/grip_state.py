# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
State of the grip with its covariance: load, unexplained pose, delay, and shifts of the contacts.

The mean of the shifts is contained in the equilibrium, see `EquilibriumCache`.
"""

from __future__ import annotations

import math

from isotruss_ros.core.estimation.contact_walk import ContactWalk, PoseNoise
from isotruss_ros.core.estimation.equilibrium_cache import EquilibriumCache
from isotruss_ros.core.estimation.grip_model import BIAS, DELAY, LOAD, shift_deviations, SHIFTS
from isotruss_ros.core.estimation.schmidt_filter import SchmidtFilter
from isotruss_ros.core.estimation.state_estimate import EstimatorSettings, SLIP_LENGTH
from isotruss_ros.core.model.pose import pose_difference
from isotruss_ros.core.numerics.arrays import Array
import numpy as np
from numpy.typing import ArrayLike

#: Random walk of the unexplained pose as a fraction of the object's motion, with the correlation
#: length `SLIP_LENGTH` [-].
POSE_WALK = 0.03
#: Prior standard deviation of the time by which poses are older than their stamps say, and
#: interval over which the object's velocity is measured [s].
DELAY_DEVIATION = 0.03
#: Number of standard deviations [-]: a pose is inconsistent if its innovation is larger (one of
#: 60000 valid poses is), and contacts have slipped if corrections and load are larger.
MAX_DEVIATIONS = 5.0


class GripState(SchmidtFilter):
    """
    Gaussian belief of the grip's state; the roller offsets are the parameters.

    :ivar load: external wrench (fx, fy, m / arm) on the object [N].
    :ivar bias: (3,) unexplained pose, rotations times the arm [m].
    :ivar delay: time by which the measured poses are older than their stamps say [s].
    :ivar innovation: normalised squared innovation (3 degrees of freedom) of the last pose [-].
    :ivar jump: length of the last innovation if it was inconsistent, otherwise 0 [m].
    :ivar walk: sums of the pose corrections, from which slip is detected.
    :ivar noise: estimated noise of the poses.

    :param offsets: (r, r) prior covariance of the roller offsets [m^2].
    :param noise: (3,) prior standard deviations of the poses, rotations times the arm [m].
    """

    def __init__(
        self, settings: EstimatorSettings, shifts: int, offsets: Array, noise: Array
    ) -> None:
        variances = np.zeros(SHIFTS + shifts)
        variances[DELAY] = DELAY_DEVIATION**2
        super().__init__(variances, offsets)
        self._settings = settings
        self.load, self.bias, self.delay = np.zeros(3), np.zeros(3), 0.0
        self.innovation, self.jump = 0.0, 0.0
        self.walk, self.noise = ContactWalk(), PoseNoise(noise**2)

    def initialise(self, cache: EquilibriumCache, friction: float) -> Array:
        """Set the prior covariance, update it by a measured pose, and return the gain (n, 3)."""
        settings = self._settings
        variances = np.diag(self.covariance).copy()  # that of the delay is kept
        variances[LOAD] = settings.load**2
        variances[BIAS] = settings.pose_error**2
        variances[SHIFTS:] = shift_deviations(cache.grasp, cache.by_shifts, friction) ** 2
        self.reset(np.diag(variances))
        # Shifts, with the covariance S of the pose, explain a part of its change B c by roller
        # offsets c. With the covariance M of model errors, M (S + M)^-1 B c is unexplained.
        rates, by_offsets = cache.rates[:3], cache.by_offsets.outputs[:3]
        by_shifts = rates[:, SHIFTS:] * variances[SHIFTS:] @ rates[:, SHIFTS:].T
        by_model = settings.pose_error**2 * np.eye(3)
        unexplained = by_model @ np.linalg.solve(by_shifts + by_model, by_offsets)
        self.covariance[BIAS, BIAS] += unexplained @ self.prior @ unexplained.T
        return self.condition(rates, by_offsets, np.diag(self.noise.variances))

    def explains(self, pose: ArrayLike, cache: EquilibriumCache) -> bool:
        """Return whether load, offsets and noise explain a pose's distance to the equilibrium."""
        distance = cache.scale[:3] * pose_difference(pose, cache.grasp.pose)
        by_offsets = cache.by_offsets.outputs[:3]
        covariance = by_offsets @ self.prior @ by_offsets.T + self._noise_with_load(cache)
        return float(distance @ np.linalg.solve(covariance, distance)) <= MAX_DEVIATIONS**2

    def correct(self, error: Array, speeds: Array, cache: EquilibriumCache, time: float) -> Array:
        """
        Update the belief with the innovation (3,) of a pose [m]; return the state's change (n,).

        The object's `speeds` (3,) are those at the pose's time, rotations times the arm [m/s].
        """
        # Measurement model of the pose, and of its part by contacts and unexplained pose (walk). A
        # pose with a longer delay is that of an earlier time, so its derivative is -speeds.
        noise = np.diag(self.noise.variances)
        by_offsets = cache.by_offsets.outputs[:3]
        rates = cache.rates[:3].copy()
        rates[:, DELAY] = -speeds
        walk_rates = cache.rates[:3].copy()
        walk_rates[:, LOAD] = 0.0
        walk_covariance = walk_rates @ self.covariance @ walk_rates.T
        # A jump is an innovation that is too large for its covariance. After a jump, contacts and
        # unexplained pose may be anywhere.
        covariance = rates @ self.covariance @ rates.T + noise
        self.innovation = float(error @ np.linalg.solve(covariance, error))
        self.jump = math.hypot(*error) if self.innovation > MAX_DEVIATIONS**2 else 0.0
        if self.jump > 0.0:
            added = np.zeros(len(self.covariance))
            added[BIAS] = added[SHIFTS:] = self.jump**2
            self.covariance = self.covariance + np.diag(added)
        # Kalman update of the state; the caller shifts the contacts.
        change = self.condition(rates, by_offsets, noise) @ error
        self.load, self.bias = self.load + change[LOAD], self.bias + change[BIAS]
        delay = self.delay + float(change[DELAY])
        self.delay = min(max(delay, 0.0), MAX_DEVIATIONS * DELAY_DEVIATION)
        correction, expected = walk_rates @ change, self._noise_with_load(cache)
        expectation = walk_covariance, expected, by_offsets, self.prior
        self.walk = self.walk.added(time, correction, *expectation)
        return change

    def propagate(
        self, elapsed: float, motion: Array, travel: Array, cache: EquilibriumCache
    ) -> Array:
        """
        Propagate the belief by process noise; return the change (3,) of the load [N].

        The object's `motion` (3,) and the roller travel (r,), which is absolute, are those in the
        `elapsed` time [m].
        """
        settings = self._settings
        noise, decay = np.zeros(len(self.covariance)), np.ones(len(self.covariance))
        # Random walks of unexplained pose, offsets and shifts, as the object and rollers move.
        slip_variances = settings.slip**2 * SLIP_LENGTH * travel
        noise[BIAS] = POSE_WALK**2 * SLIP_LENGTH * math.hypot(*motion)
        noise[SHIFTS:] = slip_variances.max()
        self.walk = self.walk.spread(cache.rates[:3] * noise @ cache.rates[:3].T)
        # The load is a first-order Gauss-Markov process, which is not part of the walk.
        remaining = math.exp(-elapsed / settings.load_time)
        noise[LOAD] = settings.load**2 * (1.0 - remaining**2)
        decay[LOAD] = remaining
        self.predict(decay, noise, slip_variances)
        load_change = (remaining - 1.0) * self.load
        self.load = self.load + load_change
        return load_change

    def _noise_with_load(self, cache: EquilibriumCache) -> Array:
        """Return the covariance (3, 3) of measured poses due to noise and load [m^2]."""
        by_load = cache.rates[:3, LOAD] * self._settings.load
        return by_load @ by_load.T + np.diag(self.noise.variances)
