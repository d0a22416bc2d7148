# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Gaussian belief of the grip: a Kalman filter about the equilibrium of the held object.

The contacts roll with the tubes, so the equilibrium follows the configuration. Measured poses
correct four states: the load w, which is an external wrench; the shift a of the contacts along the
members; the unexplained pose b, which is measured minus modelled; and the delay of the poses. The
roller offsets dphi bias the poses and are not estimated from them, see `SchmidtFilter`, because
errors of the model would count as evidence. With the roller positions q, the compliance C and
white noise v, the measured pose is

    e = (w, b, a, delay | dphi),   z = equilibrium(q + dphi, a) + C w + b + v

The stiffness of the tubes is no state: it scales forces and moves little. The dents do not become
stiffer, so the relative error of the squeeze is at most that of the stiffness, which is taken.
"""

from __future__ import annotations

import copy
from dataclasses import replace
import math

from isotruss_ros.core.estimation.contact_walk import PRIOR_DEVIATIONS
from isotruss_ros.core.estimation.equilibrium_cache import EquilibriumCache
from isotruss_ros.core.estimation.grip_model import (
    attach_model,
    BIAS,
    LOAD,
    MAX_UTILISATION,
    Pressures,
    SHIFTS,
)
from isotruss_ros.core.estimation.grip_state import DELAY_DEVIATION, GripState, MAX_DEVIATIONS
from isotruss_ros.core.estimation.input_lag import InputLag
from isotruss_ros.core.estimation.state_estimate import EstimatorSettings
from isotruss_ros.core.holding.grip_record import GripEstimate
from isotruss_ros.core.holding.held_grip import HeldGrip, HoldStatus, NotHeldError
from isotruss_ros.core.kinematics.configuration import Configuration, MAX_FIRST_ORDER_TRAVEL
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.model.pose import Pose, pose_difference
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.tolerances import ROUNDING, SMALLEST_NORMAL
from isotruss_ros.core.numerics.work_limit import WorkLimitError
import numpy as np

#: Smallest time between two equilibria [s]. In cycles between them, (19) predicts pose and
#: squeeze, and the error of this prediction in the last motion is extrapolated.
EQUILIBRIUM_PERIOD = 0.02
#: Measured roller positions (r,) [m], and their age [s].
Readings = tuple[Array, float] | None


class GripBelief:
    """
    Gaussian belief of a held object about its equilibrium, corrected by measured poses.

    :ivar scale: (3,) factors on poses, which multiply rotations by the characteristic radius.
    :ivar state: load, unexplained pose, delay and contacts' shifts, with their covariance.
    :ivar cache: equilibrium without a load, and its derivatives.
    :ivar lag: delays of the inputs.

    :param grasp: equilibrium near the measured pose, see `attach_model`.
    :param zero_covariance: (r, r) covariance of the roller offsets [m^2]; None: uncorrelated
        offsets with the standard deviation of the settings.
    :param noise: (3,) prior standard deviations of the measured poses [m, rad].
    :param is_assumed: whether the squeeze is assumed, and thus unknown, until an equilibrium near
        the measured pose is found.
    """

    def __init__(
        self,
        grasp: HeldGrip,
        grip: Grip,
        settings: EstimatorSettings,
        zero_covariance: Array | None = None,
        noise: Array = PRIOR_DEVIATIONS,
        is_assumed: bool = False,
    ) -> None:
        self.settings, self._start_grip, self._friction = settings, grip, grip.friction
        # In many assumed starts nothing is gripped. The factor 0.7 makes this show after 9 to 16
        # mm of path; with the factor 1 it shows after 24 mm.
        self._max_deviations = (0.7 if is_assumed else 1.0) * MAX_DEVIATIONS
        self.is_assumed = is_assumed
        self.scale = np.array([1.0, 1.0, grasp.arm])
        rollers = len(grasp.config.roller_positions)
        if zero_covariance is None:
            zero_covariance = settings.zero_deviation**2 * np.eye(rollers)
        self.state = GripState(settings, len(grasp.members), zero_covariance, self.scale * noise)
        self.cache = EquilibriumCache(grasp, grip.friction)
        self.lag = InputLag.of(np.array(grasp.pose))
        self._search_time = self._equilibrium_time = 0.0  # last search, last equilibrium [s]
        # Hold status if the search that is due in the next cycle fails; None: no search is due.
        self._search_due: HoldStatus | None = None
        self._start_at(np.array(grip.body.pose))

    @property
    def grasp(self) -> HeldGrip:
        """Return the equilibrium without a load, in the current configuration."""
        return self.cache.grasp

    @property
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

    @property
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
        grasp, start_pose = self.grasp, self._start_grip.body.pose
        if grasp.sections.used.max() > MAX_UTILISATION and not self.is_assumed:
            return HoldStatus.WRINKLES
        # The required friction has the relative error that geometry causes in the squeeze; the
        # stiffness scales forces alike.
        relative_error = 2.0 * self.geometric_deviation / max(self.squeeze, SMALLEST_NORMAL)
        hold = grasp.hold(self._friction * (1.0 + relative_error))
        is_far = hold is HoldStatus.HELD and not self.state.explains(start_pose, self.cache)
        return HoldStatus.FAR if is_far else hold

    @property
    def estimate(self) -> GripEstimate:
        """Return the estimates of pose, squeeze and delay."""
        covariance = self.state.spread(self.cache.rates[:3], self.cache.by_offsets.outputs[:3])
        covariance /= np.outer(self.scale, self.scale)
        deviation, delay = self.squeeze_deviation, self.state.delay
        return GripEstimate(self.pose, covariance, self.squeeze, deviation, delay)

    @property
    def correction(self) -> Array:
        """Return the estimated pose minus the pose by roller travel alone, (3,) [m]."""
        return self.scale * pose_difference(self.pose, self.lag.rolled_poses.last[1])

    @property
    def regulated(self) -> Array:
        """Return pose and squeeze (4,) for control, whose corrections are low-pass filtered."""
        return self.outputs - self.lag.filters.sum(axis=0)

    @property
    def slip_margin(self) -> float:
        """
        Return the object's slip margin without load and without earlier sliding [N].

        An object that has slid into place uses all of its friction, and is held nevertheless.
        """
        return self.cache.margin() + self._lost_margin

    @property
    def slip_deviations(self) -> float:
        """Return the norm of pose corrections, load and delay in standard deviations [-]."""
        load_deviation = max(self.settings.load, 0.5 * self.slip_margin)
        loads = self.state.load / load_deviation
        return math.hypot(self.state.walk.deviations, self.state.delay / DELAY_DEVIATION, *loads)

    @property
    def slipped(self) -> bool:
        """Return whether `slip_deviations` are so large that the object has slipped."""
        return self.slip_deviations > self._max_deviations

    def follow(
        self, config: Configuration, elapsed: float, pressures: Pressures, rollers: Readings = None
    ) -> HoldStatus:
        """
        Roll the equilibrium to the current configuration; return the new hold status.

        Within `EQUILIBRIUM_PERIOD` of the last equilibrium, pose and squeeze are predicted
        instead. If a contact slips or opens in the model, the equilibrium near the estimated pose
        is searched once, in the next call. With `limited_work` it is predicted until the work is
        done.

        :param elapsed: time since the last call [s].
        :param rollers: readings from which the configuration was predicted; None: the
            configuration is measured.
        """
        cache, lag, state = self.cache, self.lag, self.state
        self.lag = lag = replace(lag, time=lag.time + elapsed)
        interval = lag.time - self._equilibrium_time

        # Prediction from the last equilibrium, to first order.
        has_corrections = cache.zero_corrections.any()
        travel, is_predictable = cache.predict(config)
        predicted_motion = cache.predicted[:3]
        measured, age = rollers or (config.roller_positions, 0.0)
        motion_since_reading = cache.travel_rates[:3] @ (config.roller_positions - measured)
        is_early = interval < EQUILIBRIUM_PERIOD - ROUNDING
        rolled: HeldGrip | None = None
        hold = HoldStatus.HELD
        if self._search_due is not None:
            hold = self._search(config, pressures)
        elif not (is_early and is_predictable and not has_corrections):
            rolled, self._search_due = self._roll(config, pressures)
        if rolled is None:
            predicted_pose = lag.pose_at_equilibrium + predicted_motion
            if self.cache is not cache:  # the new equilibrium is that in this configuration
                lag = replace(self.lag, pose_at_equilibrium=predicted_pose)
            self.lag = lag.recorded(predicted_pose, motion_since_reading, age)
            return hold

        # Motion of the object since the last equilibrium.
        change = pose_difference(np.append(rolled.pose, rolled.squeeze), cache.outputs)
        motion = predicted_motion if has_corrections else change[:3]
        if has_corrections:
            # Corrections of offsets do not move the object; the unexplained pose changes instead.
            state.bias = state.bias - self.scale * (change[:3] - motion)
        else:
            cache.learn(rolled, travel, change, interval)
        pose = lag.pose_at_equilibrium + motion
        lag = replace(lag, pose_at_equilibrium=pose)
        self.lag = lag = lag.recorded(pose, motion_since_reading, age)
        self.take(rolled)

        # Process noise; the expected load decays, which moves the estimated pose.
        load_change = state.propagate(interval, self.scale * motion, np.abs(travel), cache)
        self.lag = lag.held_back(cache.rates[:, LOAD] @ load_change / cache.scale)

        if self._needs_search():
            self._search_due = HoldStatus.HELD
        return HoldStatus.HELD  # slip is detected from the poses

    def _roll(
        self, config: Configuration, pressures: Pressures
    ) -> tuple[HeldGrip | None, HoldStatus | None]:
        """Return the rolled equilibrium; if it is not held, None and its hold status instead."""
        try:
            rolled = self.cache.roll(config, pressures)
        except WorkLimitError as error:
            return None, None if error.advances else HoldStatus.NO_BALANCE
        hold = HoldStatus.NO_BALANCE if rolled is None else self._hold(rolled)
        return (rolled, None) if hold in (HoldStatus.HELD, HoldStatus.SLIPS) else (None, hold)

    def _search(self, config: Configuration, pressures: Pressures) -> HoldStatus:
        """Search the equilibrium; return the hold status. The next cycle continues the work."""
        failure, self._search_due = self._search_due, None
        try:
            is_found = self.attach(config, pressures)
        except WorkLimitError as error:
            is_found = error.advances
            self._search_due = failure if error.advances else None
        return HoldStatus.HELD if is_found or failure is None else failure

    def _needs_search(self) -> bool:
        """Return whether derivatives are no longer valid, or contacts slip in the model."""
        corrections = np.abs(self.cache.corrections_since_search)
        are_rates_invalid = bool(corrections.max() > MAX_FIRST_ORDER_TRAVEL)
        # A search after a shorter time would attribute transient loads to the contacts.
        is_load_over = self.lag.time - self._search_time > self.settings.load_time
        slips = self.grasp.required_friction > self._friction
        return are_rates_invalid or (slips and is_load_over and not self.is_assumed)

    def observe(self, pose: Pose, age: float) -> None:
        """
        Update the belief of the grip with a measured pose.

        :param age: time from the stamp of the pose to the last call of `follow` [s].
        """
        cache, lag, rolled_poses = self.cache, self.lag, self.lag.rolled_poses
        time = lag.time - age - self.state.delay  # at which the pose was measured
        rolled_pose = rolled_poses.at(time)
        # Velocity before that time; readings then have noise independent of the innovation's.
        interval_end = rolled_poses.at(time - DELAY_DEVIATION)
        interval_start = rolled_poses.at(time - 2.0 * DELAY_DEVIATION)
        velocity = self.scale * (interval_end - interval_start) / DELAY_DEVIATION
        # Innovation: measured pose minus the pose that was estimated for that time.
        motion_since = pose_difference(rolled_poses.last[1], rolled_pose)
        innovation = self.scale * pose_difference(pose, self.pose - motion_since)
        residual = self.scale * pose_difference(pose, rolled_pose)
        self.state.noise = self.state.noise.added(residual)
        # Kalman update; for control, the correction passes the low-pass filters.
        outputs_before = self.outputs
        change = self.state.correct(innovation, velocity, cache, lag.time)
        cache.shift(change[SHIFTS:])
        self.lag = lag.held_back(self.outputs - outputs_before)

    def attach(self, config: Configuration, pressures: Pressures) -> bool:
        """
        Search the equilibrium near the estimated pose, and initialise the contacts' shifts there.

        :return: whether an equilibrium exists that explains the pose, with a utilisation of at
            most `MAX_UTILISATION` or that of the present equilibrium.
        """
        self._search_time = self.lag.time
        limit = max(MAX_UTILISATION, self.grasp.sections.used.max())
        pose_without_load = self.pose - self.grasp.response.pose @ self.state.load
        grip = self._start_grip.moved_to(pose_without_load)
        try:
            grasp = attach_model(config, grip, pressures, self.settings.zero_deviation)
        except NotHeldError:
            return False
        if grasp.hold(math.inf) is not HoldStatus.HELD or grasp.sections.used.max() > limit:
            return False
        cache = EquilibriumCache(grasp, self._friction)
        if not self.state.explains(pose_without_load, cache):
            return False
        squeeze_before, rates_before = self.squeeze, self.cache.by_offsets.outputs
        jump = (cache.by_offsets.outputs - rates_before)[:3]
        # A bound on work may stop the start, which then leaves this belief as it is.
        started = copy.copy(self)
        started.is_assumed, started.cache, started.state = False, cache, copy.copy(self.state)
        started._fit_state()
        started._start_at(pose_without_load)
        self.__dict__.update(started.__dict__)
        self.state.walk = self.state.walk.without_jump(jump)
        self.lag = self.lag.held_back(np.append(np.zeros(3), self.squeeze - squeeze_before))
        return True

    def _start_at(self, pose: Array) -> None:
        """
        Initialise the state with a pose (3,) without load [m, rad].

        The contacts are shifted toward it within friction, unless the equilibrium is assumed; the
        distance that remains is the unexplained pose.
        """
        cache, start, friction = self.cache, self.grasp, self._friction
        self._lost_margin = 0.0  # slip margin lost by the contact history [N]
        shifts = np.zeros(len(start.members))
        # The second step has the derivatives at the first solution.
        for _ in range(0 if self.is_assumed else 2):
            # Gauss-Newton step for the shifts that explain the pose.
            gain = self.state.initialise(cache, friction)
            error = self.scale * pose_difference(pose, self.grasp.pose)
            error_without_shifts = error + cache.rates[:3, SHIFTS:] @ shifts
            estimated_shifts = (gain @ error_without_shifts)[SHIFTS:]
            further_shifts = (estimated_shifts - shifts)[cache.grasp.contacts.owners]
            shifted = cache.roll(start.config, start.pressures, further_shifts)
            # Forces beyond friction and contacts of other members are attributed to wrong offsets,
            # so the shifts are not applied.
            if shifted is None or len(shifted.members) != len(shifts):
                break
            if self._hold(shifted) is not HoldStatus.HELD:
                break
            shifts = estimated_shifts
            self._lost_margin = start.slip_margin(friction) - shifted.slip_margin(friction)
            self.take(shifted)
        self.state.bias = self.scale * pose_difference(pose, self.grasp.pose)
        self.state.initialise(cache, friction)

    def _hold(self, grasp: HeldGrip) -> HoldStatus:
        """Return the hold status of an equilibrium; `UNSTABLE` if it has no response to loads."""
        if grasp.response is None:
            return HoldStatus.UNSTABLE
        return grasp.hold((1.0 + 2.0 * self.settings.squeeze_error) * self._friction)

    def correct_zeros(self, correction: Array) -> None:
        """
        Add a correction (r,) to the roller offsets without changing the object's pose [m].

        The next equilibrium contains the correction; until then the squeeze follows to first
        order.
        """
        self.cache.correct_zeros(correction, self.state.sensitivity)

    def take(self, grasp: HeldGrip) -> None:
        """Replace the equilibrium, for example by one that another belief has found."""
        self.cache.take(grasp)
        self._fit_state()

    def _fit_state(self) -> None:
        """Resize the state to a new equilibrium's members, with a wide prior of the shifts."""
        self._equilibrium_time = self.lag.time
        size = self.cache.rates.shape[1]
        if size != len(self.state.covariance):
            self.state.resize(size, SHIFTS, self.grasp.arm**2)
