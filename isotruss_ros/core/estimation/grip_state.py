# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
State of the grip with its covariance: load, unexplained pose, delay, and shifts of the contacts.

The mean of the shifts is contained in the equilibrium, see `EquilibriumCache`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
import math

from isotruss_ros.core.estimation.contact_walk import ContactWalk, PoseNoise
from isotruss_ros.core.estimation.equilibrium_cache import EquilibriumCache
from isotruss_ros.core.estimation.fault_thresholds import MAX_DEVIATIONS
from isotruss_ros.core.estimation.grip_model import BIAS, DELAY, LOAD, shift_deviations, SHIFTS
from isotruss_ros.core.estimation.schmidt_filter import SchmidtFilter
from isotruss_ros.core.estimation.state_estimate import EstimatorSettings, SLIP_LENGTH
from isotruss_ros.core.model.pose import pose_difference
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.frozen import replace
import numpy as np
from numpy.typing import ArrayLike

#: Random walk of the unexplained pose as a fraction of the object's motion, with the correlation
#: length `SLIP_LENGTH` [-].
POSE_WALK = 0.03
#: Prior standard deviation of the time by which poses are older than their stamps say, and
#: interval over which the object's velocity is measured [s].
DELAY_DEVIATION = 0.03


@dataclass(frozen=True, eq=False)
class GripState(SchmidtFilter):
    """
    Gaussian belief of the grip's state; the roller offsets are the parameters.

    :ivar settings: deviations of priors and process noise.
    :ivar noise: estimated noise of the poses.
    :ivar load: external wrench (fx, fy, m / arm) on the object [N].
    :ivar bias: (3,) unexplained pose, rotations times the arm [m].
    :ivar delay: time by which the measured poses are older than their stamps say [s].
    :ivar innovation: normalised squared innovation (3 degrees of freedom) of the last pose [-].
    :ivar jump: length of the last innovation if it was inconsistent, otherwise 0 [m].
    :ivar walk: sums of the pose corrections, from which slip is detected.
    """

    settings: EstimatorSettings
    noise: PoseNoise
    load: Array = field(default_factory=partial(np.zeros, 3))
    bias: Array = field(default_factory=partial(np.zeros, 3))
    delay: float = 0.0
    innovation: float = 0.0
    jump: float = 0.0
    walk: ContactWalk = field(default_factory=ContactWalk)

    @classmethod
    def of(
        cls, settings: EstimatorSettings, shifts: int, offsets: Array, noise: Array
    ) -> GripState:
        """
        Return the state before the first pose.

        :param shifts: number of the contacts' shifts.
        :param offsets: (r, r) prior covariance of the roller offsets [m^2].
        :param noise: (3,) prior standard deviations of the poses, rotations times the arm [m].
        """
        variances = np.zeros(SHIFTS + shifts)
        variances[DELAY] = DELAY_DEVIATION**2
        sensitivity = np.zeros((len(variances), len(offsets)))
        return cls(np.diag(variances), sensitivity, offsets, settings, PoseNoise(noise**2))

    def initialised(self, cache: EquilibriumCache, friction: float) -> tuple[GripState, Array]:
        """Return the prior after a measured pose, and the gain (n, 3) of the pose."""
        settings = self.settings
        variances = np.diag(self.covariance).copy()  # that of the delay is kept
        variances[LOAD] = settings.load**2
        variances[BIAS] = settings.pose_error**2
        variances[SHIFTS:] = shift_deviations(cache.held, cache.by_shifts, friction) ** 2
        covariance = np.diag(variances)
        # Shifts, with the covariance S of the pose, explain a part of its change B c by roller
        # offsets c. With the covariance M of model errors, M (S + M)^-1 B c is unexplained.
        rates, by_offsets = cache.rates[:3], cache.by_offsets.outputs[:3]
        by_shifts = rates[:, SHIFTS:] * variances[SHIFTS:] @ rates[:, SHIFTS:].T
        by_model = settings.pose_error**2 * np.eye(3)
        unexplained = by_model @ np.linalg.solve(by_shifts + by_model, by_offsets)
        covariance[BIAS, BIAS] += unexplained @ self.prior @ unexplained.T
        independent = np.zeros_like(self.sensitivity)
        prior = replace(self, covariance=covariance, sensitivity=independent)
        return prior.conditioned(rates, by_offsets, np.diag(self.noise.variances))

    def explains(self, pose: ArrayLike, cache: EquilibriumCache) -> bool:
        """Return whether load, offsets and noise explain a pose's distance to the equilibrium."""
        distance = cache.scale[:3] * pose_difference(pose, cache.held.pose)
        by_offsets = cache.by_offsets.outputs[:3]
        covariance = by_offsets @ self.prior @ by_offsets.T + self._noise_with_load(cache)
        return float(distance @ np.linalg.solve(covariance, distance)) <= MAX_DEVIATIONS**2

    def corrected(
        self, error: Array, speeds: Array, cache: EquilibriumCache, time: float
    ) -> tuple[GripState, Array]:
        """
        Return the belief after the innovation (3,) of a pose [m], and the state's change (n,).

        The caller shifts the contacts. The object's `speeds` (3,) are those at the pose's time,
        rotations times the arm [m/s].
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
        innovation = float(error @ np.linalg.solve(covariance, error))
        jump = math.hypot(*error) if innovation > MAX_DEVIATIONS**2 else 0.0
        prior = self
        if jump > 0.0:
            added = np.zeros(len(self.covariance))
            added[BIAS] = added[SHIFTS:] = jump**2
            prior = replace(self, covariance=self.covariance + np.diag(added))
        # Kalman update of the state.
        state, gain = prior.conditioned(rates, by_offsets, noise)
        change = gain @ error
        delay = self.delay + float(change[DELAY])
        correction, expected = walk_rates @ change, self._noise_with_load(cache)
        expectation = walk_covariance, expected, by_offsets, self.prior
        state = replace(
            state,
            load=self.load + change[LOAD],
            bias=self.bias + change[BIAS],
            delay=min(max(delay, 0.0), MAX_DEVIATIONS * DELAY_DEVIATION),
            innovation=innovation,
            jump=jump,
            walk=self.walk.added(time, correction, *expectation),
        )
        return state, change

    def propagated(
        self, elapsed: float, motion: Array, travel: Array, cache: EquilibriumCache
    ) -> tuple[GripState, Array]:
        """
        Return the belief after process noise, and the change (3,) of the load [N].

        The object's `motion` (3,) and the roller travel (r,), which is absolute, are those in the
        `elapsed` time [m].
        """
        settings = self.settings
        noise, decay = np.zeros(len(self.covariance)), np.ones(len(self.covariance))
        # Random walks of unexplained pose, offsets and shifts, as the object and rollers move.
        slip_variances = settings.slip**2 * SLIP_LENGTH * travel
        noise[BIAS] = POSE_WALK**2 * SLIP_LENGTH * math.hypot(*motion)
        noise[SHIFTS:] = slip_variances.max()
        walk_covariance = self.walk.walk + cache.rates[:3] * noise @ cache.rates[:3].T
        walk = replace(self.walk, walk=walk_covariance)
        # The load is a first-order Gauss-Markov process, which is not part of the walk.
        remaining = math.exp(-elapsed / settings.load_time)
        noise[LOAD] = settings.load**2 * (1.0 - remaining**2)
        decay[LOAD] = remaining
        load_change = (remaining - 1.0) * self.load
        state = self.predicted(decay, noise, slip_variances)
        return replace(state, load=self.load + load_change, walk=walk), load_change

    def _noise_with_load(self, cache: EquilibriumCache) -> Array:
        """Return the covariance (3, 3) of measured poses due to noise and load [m^2]."""
        by_load = cache.rates[:3, LOAD] * self.settings.load
        return by_load @ by_load.T + np.diag(self.noise.variances)
