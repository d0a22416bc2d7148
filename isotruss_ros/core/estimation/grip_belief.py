# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Gaussian belief of a grip."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, partial
import math
from typing import NamedTuple, TypeVar

from isotruss_ros.core.estimation.equilibrium_cache import (
    attach_model,
    BIAS,
    DELAY,
    EquilibriumCache,
    LOAD,
    MAX_UTILISATION,
    Pressures,
    shift_deviations,
    SHIFTS,
)
from isotruss_ros.core.estimation.state_estimate import (
    ASSUMED_DEVIATIONS,
    EstimatorSettings,
    MAX_DEVIATIONS,
    SLIP_LENGTH,
    SUM_INTERVALS,
)
from isotruss_ros.core.holding.grip_record import GripEstimate
from isotruss_ros.core.holding.held_grip import HeldGrip, HoldStatus, NotHeldError
from isotruss_ros.core.holding.held_shape import held_joints
from isotruss_ros.core.inputs import MAX_TIMEOUT, Timeline
from isotruss_ros.core.kinematics.configuration import Configuration, MAX_FIRST_ORDER_TRAVEL
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.model.pose import Pose, pose_difference
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.records import replace
from isotruss_ros.core.numerics.tolerances import SMALLEST_NORMAL
from isotruss_ros.core.numerics.work_limit import WorkLimitError
import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import lapack

# Covariances of a Schmidt-Kalman filter, whose measurements are biased by constant parameters.
#
# The parameters are not estimated. The state is estimated as if they were zero, so its error is
# e + S c, where e is an error with the covariance P, and S is the sensitivity to the parameters c.

F = TypeVar('F', bound='SchmidtFilter')


def condition(covariance: Array, rates: Array, noise: Array) -> tuple[Array, Array, Array]:
    """Return the Kalman gain K, I - K H and the covariance after a measurement by `rates` H."""
    gain = np.linalg.solve(rates @ covariance @ rates.T + noise, rates @ covariance).T
    remaining = np.eye(len(covariance)) - gain @ rates
    updated = remaining @ covariance @ remaining.T + gain @ noise @ gain.T
    return gain, remaining, 0.5 * (updated + updated.T)


@dataclass(frozen=True, eq=False)
class SchmidtFilter:
    """
    Covariances of a state (n,) and of parameters (c,) that are not estimated.

    :ivar covariance: (n, n) covariance P of the state's own error.
    :ivar sensitivity: (n, c) derivatives S of the state's error with respect to the parameters.
    :ivar prior: (c, c) covariance of the parameters.
    """

    covariance: Array
    sensitivity: Array
    prior: Array

    def resized(self: F, size: int, first: int, variance: float) -> F:
        """Return the filter of n states, of which those from `first` on have a prior variance."""
        covariance, sensitivity = variance * np.eye(size), np.zeros((size, len(self.prior)))
        covariance[:first, :first] = self.covariance[:first, :first]
        sensitivity[:first] = self.sensitivity[:first]
        return replace(self, covariance=covariance, sensitivity=sensitivity)

    def spread(self, rates: Array, by_parameters: Array) -> Array:
        """Return the covariance (m, m) of outputs with these Jacobians by state and parameters."""
        total_rates = by_parameters + rates @ self.sensitivity  # by the parameters
        return rates @ self.covariance @ rates.T + total_rates @ self.prior @ total_rates.T

    def predicted(self: F, decay: Array, noise: Array, drift: Array) -> F:
        """
        Return the filter after variances of the state's noise and the parameters' drift.

        The state x becomes A x with A = diag(`decay`). It was biased by the parameters before
        their drift; its sensitivity to the later ones is smaller (Hsieh and Chen 1999).
        """
        # Parameters with the covariance C drift to C' = C + D. Linear regression of the earlier on
        # the later ones has the matrix R = C C'^-1 and residuals with the covariance C - R C.
        prior = self.prior + np.diag(drift)
        _, transposed, info = lapack.dposv(prior, self.prior)
        if info:  # a parameter is known exactly
            transposed = np.linalg.pinv(prior, hermitian=True) @ self.prior
        regression = transposed.T
        residual = self.prior - regression @ self.prior
        # S' = A S R, and P' = A P A^T + N + A S (C - R C) (A S)^T.
        decayed = decay[:, None] * self.sensitivity
        by_residual = decayed @ residual @ decayed.T
        covariance = self.covariance * np.outer(decay, decay) + np.diag(noise)
        covariance = covariance + 0.5 * (by_residual + by_residual.T)
        return replace(self, covariance=covariance, sensitivity=decayed @ regression, prior=prior)

    def conditioned(self: F, rates: Array, by_parameters: Array, noise: Array) -> tuple[F, Array]:
        """Return the filter after a measurement (m,), and the gain (n, m) of the state."""
        gain, remaining, covariance = condition(self.covariance, rates, noise)
        sensitivity = remaining @ self.sensitivity - gain @ by_parameters
        return replace(self, covariance=covariance, sensitivity=sensitivity), gain


# Slip from sums of pose corrections of the object, and noise from successive poses.

#: Prior standard deviations of the coordinates [m] and of the angle [rad].
PRIOR_DEVIATIONS = np.array([1e-3, 1e-3, 0.009])
#: Error of the model between two poses, rotations times the characteristic radius [m].
MODEL_ERROR = 1e-4
#: Smallest weight of a pose in the average [-].
MIN_WEIGHT = 0.02
#: Largest difference of poses that counts as noise, in standard deviations [-].
MAX_STEP_SIGMAS = 3.0


class Sum(NamedTuple):
    """Sum of the pose corrections before a time, and the covariances at this time."""

    time: float  #: [s]
    correction: Array  #: (3,) sum of all earlier corrections of the pose [m]
    walk: Array  #: (3, 3) covariance of the contacts' random walk [m^2]
    prior: Array  #: (3, 3) covariance of contacts and unexplained pose [m^2]
    by_offsets: Array  #: (3, c) derivatives of the pose by the roller offsets


@dataclass(frozen=True, eq=False)
class ContactWalk:
    """
    Detector of slip from sums of pose corrections and their standard deviations without slip.

    The deviations are due to a random walk of the contacts, pose noise and load.

    :ivar length: norm of the largest sum, with rotations times the characteristic radius [m].
    :ivar deviations: largest ratio of a sum to its expected standard deviation [-].
    :ivar correction: (3,) sum of all corrections of the pose [m].
    :ivar walk: (3, 3) covariance of the contacts' random walk [m^2].
    :ivar jumps: (3, c) jumps of the derivatives by offsets, which are no slip.
    :ivar windows: sums within each of `SUM_INTERVALS`, in order of time.
    """

    length: float = 0.0
    deviations: float = 0.0
    correction: Array = field(default_factory=partial(np.zeros, 3))
    walk: Array = field(default_factory=partial(np.zeros, (3, 3)))
    jumps: Array | float = 0.0
    windows: tuple[tuple[Sum, ...], ...] = ((),) * len(SUM_INTERVALS)

    def added(
        self, time: float, change: Array, prior: Array, noise: Array, rates: Array, offsets: Array
    ) -> ContactWalk:
        """
        Return the detector after a correction (3,) of the pose, without its part by the load [m].

        :param prior: (3, 3) covariance of contacts and unexplained pose before it [m^2].
        :param noise: (3, 3) covariance of pose noise and load [m^2].
        :param rates: (3, c) derivatives of the pose by the roller offsets. If they change, an
            error of an offset moves the pose.
        :param offsets: (c, c) covariance of the roller offsets [m^2].
        """
        # The sum before this time starts a window; sums older than a window's interval leave it.
        by_offsets = rates - self.jumps
        before = Sum(time, self.correction, self.walk, prior, by_offsets)
        correction = self.correction + change
        windows = tuple(
            _drop_old((*window, before), time, interval)
            for window, interval in zip(self.windows, SUM_INTERVALS, strict=True)
        )
        # Sum of the corrections in each window. First axis: window.
        starts = [window[0] for window in windows]
        sums = correction - np.array([start.correction for start in starts])
        # Covariances of the sums without slip: S = prior + walk + noise + B C B^T.
        walks = self.walk - np.array([start.walk for start in starts])
        rate_changes = by_offsets - np.array([start.by_offsets for start in starts])
        by_rate_changes = rate_changes @ offsets @ rate_changes.transpose(0, 2, 1)
        covariances = np.array([start.prior for start in starts]) + walks + noise + by_rate_changes
        # Largest Mahalanobis distance of a sum s from zero, sqrt(s^T S^-1 s).
        weighted = np.linalg.solve(covariances, sums[:, :, None])[:, :, 0]  # sums are columns
        return replace(
            self,
            length=float(np.hypot.reduce(sums, axis=1).max()),
            deviations=math.sqrt((sums * weighted).sum(axis=1).max()),
            correction=correction,
            windows=windows,
        )


def _drop_old(window: tuple[Sum, ...], time: float, interval: float) -> tuple[Sum, ...]:
    """Return the sums of an interval [s] that ends at a time."""
    count = next(i for i, start in enumerate(window) if time - start.time <= interval)
    return window[count:]


@dataclass(frozen=True, eq=False)
class PoseNoise:
    """
    Estimated variances of white noise in the poses of a slowly moving object.

    They include the model error. Angles are multiplied by the characteristic radius.

    :ivar variances: (3,) variances [m^2].
    :ivar previous: (3,) last residual, see `added` [m]; None before the first pose.
    :ivar weight: weight of the next pose [-]; the prior weighs as much as four poses.
    """

    variances: Array
    previous: Array | None = None
    weight: float = 0.2

    def added(self, residual: Array) -> PoseNoise:
        """Return the variances after a pose (3,), minus the pose by roller travel alone [m]."""
        if self.previous is None:
            return replace(self, previous=residual)
        # Half of the square, because both residuals have noise.
        half_squares = 0.5 * (residual - self.previous) ** 2
        squares = np.minimum(half_squares, MAX_STEP_SIGMAS**2 * self.variances)
        averages = self.variances + self.weight * (squares - self.variances)
        # The weights 1/5, 1/6, 1/7, ... give the arithmetic mean, until they are the smallest.
        weight = max(self.weight / (1.0 + self.weight), MIN_WEIGHT)
        return PoseNoise(np.maximum(averages, MODEL_ERROR**2), residual, weight)


# State of the grip with its covariance: load, unexplained pose, delay, and shifts of the contacts.
#
# The mean of the shifts is contained in the equilibrium, see `EquilibriumCache`.

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


# Poses of a held object by roller travel alone, with which late measured poses are compared.


@dataclass(frozen=True, eq=False)
class RolledPoses:
    """
    Poses (x, y, angle) of a held object by roller travel alone [m, m, rad].

    :ivar at_equilibrium: pose (3,) at the last equilibrium.
    :ivar measured: time of the last measured rollers [s], and pose by their travel then.
    :ivar poses: poses (3,) over time.
    """

    at_equilibrium: Array
    measured: tuple[float, Array]
    poses: Timeline

    @classmethod
    def of(cls, pose: Array) -> RolledPoses:
        """Return the poses at the start of a belief, at the time 0."""
        return cls(pose, (0.0, pose), Timeline().added(0.0, pose))

    def recorded(self, time: float, pose: Array, age: float, motion: Array) -> RolledPoses:
        """Return the poses with one at a time [s], and that `age` [s] and `motion` before."""
        # The last call's prediction is replaced, because rollers may follow their commands late.
        measured = time - age, pose - motion
        poses = self.poses.added(*self.measured).added(*measured).added(time, pose)
        return replace(self, measured=measured, poses=poses.since(time - MAX_TIMEOUT))


# Gaussian belief of the grip: a Kalman filter about the equilibrium of the held object.
#
# The contacts roll with the tubes, so the equilibrium follows the configuration. Measured poses
# correct four states: the load w, which is an external wrench; the shift a of the contacts along
# the members; the unexplained pose b, which is measured minus modelled; and the delay of the
# poses. The roller offsets dphi bias the poses and are not estimated from them, see
# `SchmidtFilter`, because errors of the model would count as evidence. With the roller positions
# q, the compliance C and white noise v, the measured pose is
#
#     e = (w, b, a, delay | dphi),   z = equilibrium(q + dphi, a) + C w + b + v
#
# The stiffness of the tubes is no state: it scales forces and moves little. The dents do not
# become stiffer, so the relative error of the squeeze is at most that of the stiffness, which is
# taken.

#: Measured roller positions (r,) [m], and their age [s].
Readings = tuple[Array, float] | None


@dataclass(frozen=True, eq=False)
class GripBelief:
    """
    Gaussian belief of a held object about its equilibrium, corrected by measured poses.

    :ivar settings: deviations of priors, process noise and measurements.
    :ivar start_grip: grip with the measured pose at the start.
    :ivar state: load, unexplained pose, delay and contacts' shifts, with their covariance.
    :ivar cache: equilibrium without a load, and its derivatives.
    :ivar rolled_poses: poses by roller travel alone.
    :ivar is_assumed: whether the squeeze is assumed, and thus unknown, until an equilibrium near
        the measured pose is found.
    :ivar max_deviations: largest `slip_deviations` without slip [-].
    :ivar time: time since the start [s].
    :ivar search_time: time of the last search [s].
    :ivar search_due: hold status if the search that is due in the next cycle fails; None: no
        search is due.
    :ivar lost_margin: slip margin lost by earlier sliding [N].
    :ivar corrections: (4,) sum of the corrections of pose [m, m, rad] and squeeze [N] by poses.
    """

    settings: EstimatorSettings
    start_grip: Grip
    state: GripState
    cache: EquilibriumCache
    rolled_poses: RolledPoses
    is_assumed: bool
    max_deviations: float
    time: float = 0.0
    search_time: float = 0.0
    search_due: HoldStatus | None = None
    lost_margin: float = 0.0
    corrections: Array = field(default_factory=partial(np.zeros, 4))

    @classmethod
    def of(
        cls,
        held: HeldGrip,
        grip: Grip,
        settings: EstimatorSettings,
        zero_covariance: Array | None = None,
        noise: Array = PRIOR_DEVIATIONS,
        is_assumed: bool = False,
    ) -> GripBelief:
        """
        Return the belief that starts at a measured pose.

        :param held: equilibrium near the measured pose, see `attach_model`.
        :param grip: grip with the measured pose.
        :param zero_covariance: (r, r) covariance of the roller offsets [m^2]; None: uncorrelated
            offsets with the standard deviation of the settings.
        :param noise: (3,) prior standard deviations of the measured poses [m, rad].
        """
        max_deviations = ASSUMED_DEVIATIONS if is_assumed else MAX_DEVIATIONS
        if zero_covariance is None:
            rollers = len(held.config.roller_positions)
            zero_covariance = settings.zero_deviation**2 * np.eye(rollers)
        cache = EquilibriumCache.of(held, grip.friction)
        deviations = cache.scale[:3] * noise
        state = GripState.of(settings, len(held.members), zero_covariance, deviations)
        rolled_poses = RolledPoses.of(np.array(held.pose))
        belief = cls(settings, grip, state, cache, rolled_poses, is_assumed, max_deviations)
        return belief._started_at(np.array(grip.body.pose))

    @property
    def friction(self) -> float:
        """Return the coefficient of friction [-]."""
        return self.start_grip.friction

    @property
    def scale(self) -> Array:
        """Return the factors (3,) on poses, which multiply rotations by the arm."""
        return self.cache.scale[:3]

    @property
    def held(self) -> HeldGrip:
        """Return the equilibrium without a load, in the current configuration."""
        return self.cache.held

    @cached_property
    def outputs(self) -> Array:
        """Return the estimates of pose [m, m, rad] and squeeze [N], (4,)."""
        cache, state = self.cache, self.state
        by_state = cache.rates[:, LOAD] @ state.load + cache.rates[:, BIAS] @ state.bias
        return cache.outputs + cache.predicted + by_state / cache.scale

    @property
    def pose(self) -> Array:
        """Return the estimate (x, y, angle) of the object's pose [m, rad]."""
        return self.outputs[:3]

    @property
    def squeeze(self) -> float:
        """Return the estimated mean normal force of the members [N]."""
        return float(self.outputs[3])

    @cached_property
    def geometric_deviation(self) -> float:
        """
        Return the standard deviation of the squeeze without the error of the stiffness [N].

        Poses confirm neither an assumed squeeze nor that of an object that has slipped.
        """
        variance = self.state.spread(self.cache.rates[3], self.cache.by_offsets.outputs[3])
        is_unconfirmed = self.is_assumed or self.slipped
        relative = 1.0 if is_unconfirmed else self.settings.squeeze_error
        return math.hypot(math.sqrt(variance), relative * self.squeeze)

    @property
    def squeeze_deviation(self) -> float:
        """Return the standard deviation of the squeeze, with model and stiffness errors [N]."""
        return math.hypot(self.geometric_deviation, self.settings.stiffness * self.squeeze)

    @property
    def hold(self) -> HoldStatus:
        """
        Return the hold status at the start, `FAR` if the measured pose is not explained.

        A hold is refused only if it slips within the error of the model.
        """
        held, start_pose = self.held, self.start_grip.body.pose
        if held.sections.used.max() > MAX_UTILISATION and not self.is_assumed:
            return HoldStatus.WRINKLES
        # The required friction has the relative error that geometry causes in the squeeze; the
        # stiffness scales forces alike.
        relative_error = 2.0 * self.geometric_deviation / max(self.squeeze, SMALLEST_NORMAL)
        hold = held.hold(self.friction * (1.0 + relative_error))
        is_far = hold is HoldStatus.HELD and not self.state.explains(start_pose, self.cache)
        return HoldStatus.FAR if is_far else hold

    @cached_property
    def estimate(self) -> GripEstimate:
        """Return the estimates of pose, squeeze, delay and displaced joints."""
        held, state, by_offsets = self.held, self.state, self.cache.by_offsets
        covariance = state.spread(self.cache.rates[:3], by_offsets.outputs[:3])
        covariance /= np.outer(self.scale, self.scale)
        # The derivatives of the displacements are those of the loaded joints minus those of the
        # unloaded ones.
        count = len(by_offsets.joints)
        displacements = held_joints(held).ravel() - held.config.nodes.ravel()[:count]
        by_shifts = by_offsets.joints_by_shifts @ state.sensitivity[SHIFTS:]
        rates = by_offsets.joints + by_shifts - held.config.node_jacobian[:count]
        squeeze = self.squeeze, self.squeeze_deviation
        return GripEstimate(self.pose, covariance, *squeeze, state.delay, displacements, rates)

    @property
    def displacement(self) -> Array:
        """Return the estimated pose minus the pose by roller travel alone, (3,) [m]."""
        return self.scale * pose_difference(self.pose, self.rolled_poses.poses.last[1])

    @property
    def slip_margin(self) -> float:
        """
        Return the object's slip margin without load and without earlier sliding [N].

        An object that has slid into place uses all of its friction, and is held nevertheless.
        """
        return self.cache.margin + self.lost_margin

    @cached_property
    def slip_deviations(self) -> float:
        """Return the norm of pose corrections, load and delay in standard deviations [-]."""
        load_deviation = max(self.settings.load, 0.5 * self.slip_margin)
        loads = self.state.load / load_deviation
        return math.hypot(self.state.walk.deviations, self.state.delay / DELAY_DEVIATION, *loads)

    @property
    def slipped(self) -> bool:
        """Return whether `slip_deviations` are so large that the object has slipped."""
        return self.slip_deviations > self.max_deviations

    def followed(
        self, config: Configuration, elapsed: float, pressures: Pressures, rollers: Readings = None
    ) -> tuple[GripBelief, HoldStatus]:
        """
        Return the belief rolled to the current configuration, and the new hold status.

        Pose and squeeze are predicted from the last equilibrium until the next one is due, see
        `EquilibriumCache.travel_limit`. If a contact slips or opens in the model, the equilibrium
        near the estimated pose is searched once, in the next call. With `limited_work` it is
        predicted until the work is done.

        :param elapsed: time since the last call [s].
        :param rollers: readings from which the configuration was predicted; None: the
            configuration is measured.
        """
        cache = self.cache.predict(config, elapsed)
        belief = replace(self, cache=cache, time=self.time + elapsed)
        measured, age = rollers or (config.roller_positions, 0.0)
        measured_travel = cache.travel - (config.roller_positions - measured)
        motion_since_reading = (cache.predicted - cache.motion(measured_travel))[:3]
        pose, hold = self.rolled_poses.at_equilibrium + cache.predicted[:3], HoldStatus.HELD
        limit = cache.travel_limit(pressures, belief.slip_margin)
        if self.search_due is not None:
            belief, hold = belief._searched(config, pressures, pose)
        elif math.hypot(*cache.travel) > limit:
            belief, pose = belief._rolled(config, pressures, limit, pose)
        else:
            belief = replace(belief, cache=cache.prepared(config, limit))
        rolled_poses = belief.rolled_poses.recorded(belief.time, pose, age, motion_since_reading)

        # Process noise; the expected load decays, which moves the estimated pose.
        moved = self.scale * cache.moved[:3], np.abs(cache.step), belief.cache
        state, load_change = belief.state.propagated(elapsed, *moved)
        by_load = belief.cache.rates[:, LOAD] @ load_change / belief.cache.scale
        search_due = belief.search_due
        if search_due is None and belief._needs_search():
            search_due = HoldStatus.HELD
        belief = replace(
            belief,
            state=state,
            rolled_poses=rolled_poses,
            corrections=belief.corrections + by_load,
            search_due=search_due,
        )
        return belief, hold  # slip is detected from the poses

    def _rolled(
        self, config: Configuration, pressures: Pressures, limit: float, pose: Array
    ) -> tuple[GripBelief, Array]:
        """
        Return the belief about the rolled equilibrium; if it is not held, a search is due.

        :param limit: travel up to which an equilibrium is valid [m].
        :param pose: predicted pose (3,) by roller travel alone [m, m, rad].
        :return: the belief, and this pose with the motion to the equilibrium.
        """
        cache, state = self.cache, self.state
        rolled, search_due = self._roll(config, pressures, limit)
        if rolled is None:
            return replace(self, search_due=search_due), pose
        change = pose_difference(np.append(rolled.pose, rolled.squeeze), cache.outputs)[:3]
        if cache.zero_corrections.any():
            # Corrections of offsets do not move the object; the unexplained pose changes instead.
            unexplained = self.scale * (change - cache.predicted[:3])
            state = replace(state, bias=state.bias - unexplained)
        else:
            cache = cache.predict(rolled.config, 0.0)
            pose = self.rolled_poses.at_equilibrium + change
        rolled_poses = replace(self.rolled_poses, at_equilibrium=pose)
        belief = replace(self, rolled_poses=rolled_poses, state=state, cache=cache).taken(rolled)
        cache = belief.cache.predict(config, 0.0)
        return replace(belief, cache=cache), pose + cache.predicted[:3]

    def _roll(
        self, config: Configuration, pressures: Pressures, limit: float
    ) -> tuple[HeldGrip | None, HoldStatus | None]:
        """Return the rolled equilibrium; if it is not held, None and its hold status instead."""
        try:
            rolled = self.cache.roll_begun(config, limit) or self.cache.roll(config, pressures)
        except WorkLimitError as error:
            return None, None if error.advances else HoldStatus.NO_BALANCE
        hold = HoldStatus.NO_BALANCE if rolled is None else self._hold(rolled)
        return (rolled, None) if hold in (HoldStatus.HELD, HoldStatus.SLIPS) else (None, hold)

    def _searched(
        self, config: Configuration, pressures: Pressures, pose: Array
    ) -> tuple[GripBelief, HoldStatus]:
        """
        Return the belief after a search, and the hold status; the next cycle may continue.

        :param pose: pose (3,) by roller travel alone [m, m, rad].
        """
        failure = self.search_due
        belief = replace(self, search_due=None, search_time=self.time)
        try:
            attached = belief._attached(config, pressures)
        except WorkLimitError as error:
            if error.advances:
                return replace(belief, search_due=failure), HoldStatus.HELD
            attached = None
        if attached is None:
            return belief, failure
        rolled_poses = replace(self.rolled_poses, at_equilibrium=pose)
        return replace(attached, rolled_poses=rolled_poses), HoldStatus.HELD

    def _needs_search(self) -> bool:
        """Return whether derivatives are no longer valid, or contacts slip in the model."""
        corrections = np.abs(self.cache.corrections_since_search)
        are_rates_invalid = bool(corrections.max() > MAX_FIRST_ORDER_TRAVEL)
        # A search after a shorter time would attribute transient loads to the contacts.
        is_load_over = self.time - self.search_time > self.settings.load_time
        slips = self.held.required_friction > self.friction
        return are_rates_invalid or (slips and is_load_over and not self.is_assumed)

    def observed(self, pose: Pose, age: float) -> GripBelief:
        """
        Return the belief after a measured pose.

        :param age: time from the stamp of the pose to the last call of `followed` [s].
        """
        rolled_poses = self.rolled_poses.poses
        time = self.time - age - self.state.delay  # at which the pose was measured
        rolled_pose = rolled_poses.at(time)
        # Velocity before that time; readings then have noise independent of the innovation's.
        interval_end = rolled_poses.at(time - DELAY_DEVIATION)
        interval_start = rolled_poses.at(time - 2.0 * DELAY_DEVIATION)
        velocity = self.scale * (interval_end - interval_start) / DELAY_DEVIATION
        # Innovation: measured pose minus the pose that was estimated for that time.
        motion_since = pose_difference(rolled_poses.last[1], rolled_pose)
        innovation = self.scale * pose_difference(pose, self.pose - motion_since)
        noise = self.state.noise.added(self.scale * pose_difference(pose, rolled_pose))
        # Kalman update, which moves the estimates.
        state = replace(self.state, noise=noise)
        state, change = state.corrected(innovation, velocity, self.cache, self.time)
        belief = replace(self, state=state, cache=self.cache.shifted(change[SHIFTS:]))
        corrections = self.corrections + (belief.outputs - self.outputs)
        return replace(belief, corrections=corrections)

    def _attached(self, config: Configuration, pressures: Pressures) -> GripBelief | None:
        """
        Search the equilibrium near the estimated pose; return the belief that restarts there.

        :return: None if no equilibrium explains the pose, with a utilisation of at most
            `MAX_UTILISATION` or that of the present equilibrium.
        """
        limit = max(MAX_UTILISATION, self.held.sections.used.max())
        pose_without_load = self.pose - self.held.response.pose @ self.state.load
        grip = self.start_grip.moved_to(pose_without_load)
        try:
            held = attach_model(config, grip, pressures, self.settings.zero_deviation)
        except NotHeldError:
            return None
        if held.hold(math.inf) is not HoldStatus.HELD or held.sections.used.max() > limit:
            return None
        cache = EquilibriumCache.of(held, self.friction)
        if not self.state.explains(pose_without_load, cache):
            return None
        jump = (cache.by_offsets.outputs - self.cache.by_offsets.outputs)[:3]
        started = replace(self, is_assumed=False, cache=cache)._fitted()
        started = started._started_at(pose_without_load)
        walk = started.state.walk
        state = replace(started.state, walk=replace(walk, jumps=walk.jumps + jump))
        jump_of_squeeze = np.append(np.zeros(3), started.squeeze - self.squeeze)
        return replace(started, state=state, corrections=self.corrections + jump_of_squeeze)

    def _started_at(self, pose: Array) -> GripBelief:
        """
        Return the belief that starts at a pose (3,) without load [m, rad].

        The contacts are shifted toward it within friction, unless the equilibrium is assumed; the
        distance that remains is the unexplained pose.
        """
        belief, start, friction = replace(self, lost_margin=0.0), self.held, self.friction
        shifts = np.zeros(len(start.members))
        # The second step has the derivatives at the first solution. The squeeze of a box that is
        # tilted off its face errs by 3.4 % after the first, and by less than 1 % after the second.
        for _ in range(0 if self.is_assumed else 2):
            # Gauss-Newton step for the shifts that explain the pose.
            cache = belief.cache
            state, gain = belief.state.initialised(cache, friction)
            belief = replace(belief, state=state)
            error = self.scale * pose_difference(pose, cache.held.pose)
            error_without_shifts = error + cache.rates[:3, SHIFTS:] @ shifts
            estimated_shifts = (gain @ error_without_shifts)[SHIFTS:]
            further_shifts = (estimated_shifts - shifts)[cache.held.contacts.owners]
            shifted = cache.roll(start.config, start.pressures, further_shifts)
            # Forces beyond friction and contacts of other members are attributed to wrong offsets,
            # so the shifts are not applied.
            if shifted is None or len(shifted.members) != len(shifts):
                break
            if self._hold(shifted) is not HoldStatus.HELD:
                break
            shifts = estimated_shifts
            lost_margin = start.slip_margin(friction) - shifted.slip_margin(friction)
            belief = replace(belief, lost_margin=lost_margin).taken(shifted)
        bias = self.scale * pose_difference(pose, belief.held.pose)
        state, _ = replace(belief.state, bias=bias).initialised(belief.cache, friction)
        return replace(belief, state=state)

    def _hold(self, held: HeldGrip) -> HoldStatus:
        """Return the hold status of an equilibrium; `UNSTABLE` if it has no response to loads."""
        if held.response is None:
            return HoldStatus.UNSTABLE
        return held.hold((1.0 + 2.0 * self.settings.squeeze_error) * self.friction)

    def with_zeros_corrected(self, correction: Array) -> GripBelief:
        """
        Return the belief with a correction (r,) of the roller offsets, at the same pose [m].

        The next equilibrium contains the correction; until then the squeeze follows to first
        order.
        """
        return replace(self, cache=self.cache.corrected(correction, self.state.sensitivity))

    def taken(self, held: HeldGrip) -> GripBelief:
        """Return the belief at another equilibrium, see `EquilibriumCache.taken`."""
        return replace(self, cache=self.cache.taken(held))._fitted()

    def _fitted(self) -> GripBelief:
        """Return the belief with a state for the equilibrium's members; shifts have a prior."""
        size, state = self.cache.rates.shape[1], self.state
        if size != len(state.covariance):
            state = state.resized(size, SHIFTS, self.held.arm**2)
        return replace(self, state=state)
