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

The stiffness of the tubes is no state: it scales all forces and moves nothing.
"""

from __future__ import annotations

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
import numpy as np

#: Smallest time between two equilibria [s]. In cycles between them, (19) predicts pose and
#: squeeze, and the error of this prediction in the last motion is extrapolated.
EQUILIBRIUM_PERIOD = 0.02
#: Measured roller positions (r,) [m], and their age [s].
Readings = tuple[Array, float] | None


class GripBelief:
    """
    Belief of a held object: an equilibrium of the model, corrected by measured poses.

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
        self.settings, self._given, self._friction = settings, grip, grip.friction
        # In many assumed starts nothing is gripped. The factor 0.7 makes this show after 9 to 16
        # mm of path; with the factor 1 it shows after 24 mm.
        self._most = (0.7 if is_assumed else 1.0) * MAX_DEVIATIONS
        self.is_assumed = is_assumed
        self._even = np.array([1.0, 1.0, grasp.arm])
        count = len(grasp.config.roller_positions)
        if zero_covariance is None:
            zero_covariance = settings.zero_deviation**2 * np.eye(count)
        self.state = GripState(settings, len(grasp.members), zero_covariance, self._even * noise)
        self.cache = EquilibriumCache(grasp, grip.friction)
        self.lag = InputLag(np.array(grasp.pose))
        self._searched = self._rolled = 0.0  # times of the last search and equilibrium
        self._corrected = np.zeros(count)
        self._spare = 0.0  # slip margin lost by the contact history [N]
        self._start_at(np.array(grip.body.pose))

    @property
    def grasp(self) -> HeldGrip:
        """Return the equilibrium without a load, in the current configuration."""
        return self.cache.grasp

    @property
    def grip(self) -> Grip:
        """Return the grip from which (19) predicts the motion of the object."""
        return self.cache.grip

    @property
    def outputs(self) -> Array:
        """Return the estimates of pose [m, m, rad] and squeeze [N], (4,)."""
        cache, state = self.cache, self.state
        by_state = cache.rates[:, LOAD] @ state.load + cache.rates[:, BIAS] @ state.bias
        return cache.outputs + cache.ahead + by_state / cache.scale

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
        Return the deviation of the squeeze for the stiffness of the robot file [N].

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
        Return the hold status of the object at the measured pose of the start.

        The required friction has the relative error of the squeeze, but does not depend on the
        stiffness.
        """
        grasp, measured = self.grasp, self._given.body.pose
        if grasp.sections.used.max() > MAX_UTILISATION and not self.is_assumed:
            return HoldStatus.WRINKLES
        error = 2.0 * self.geometric_deviation / max(self.squeeze, SMALLEST_NORMAL)
        hold = grasp.hold(self._friction * (1.0 + error))
        explained = hold is not HoldStatus.HELD or self.state.explains(measured, self.cache)
        return hold if explained else HoldStatus.FAR

    @property
    def estimate(self) -> GripEstimate:
        """Return the estimates of pose, squeeze and delay."""
        covariance = self.state.spread(self.cache.rates[:3], self.cache.by_offsets.outputs[:3])
        covariance /= np.outer(self._even, self._even)
        deviation, delay = self.squeeze_deviation, self.state.delay
        return GripEstimate(self.pose, covariance, self.squeeze, deviation, delay)

    @property
    def correction(self) -> Array:
        """Return the part (3,) of the pose that roller travel does not explain [m]."""
        return self._even * pose_difference(self.pose, self.lag.way.last[1])

    @property
    def regulated(self) -> Array:
        """Return pose and squeeze (4,) for control, with corrections smoothed by two filters."""
        return self.outputs - self.lag.filters.sum(axis=0)

    @property
    def slip_margin(self) -> float:
        """
        Return the object's slip margin without load and for unknown contact history [N].

        An object that has slid into place uses all of its friction, and is held nevertheless.
        """
        return self.cache.margin() + self._spare

    @property
    def slip_deviations(self) -> float:
        """Return the norm of pose corrections, load and delay in standard deviations [-]."""
        state, least = self.state, max(self.settings.load, 0.5 * self.slip_margin)
        delayed = state.delay / DELAY_DEVIATION
        return math.hypot(state.walk.deviations, delayed, *(state.load / least))

    @property
    def slipped(self) -> bool:
        """Return whether `slip_deviations` are so large that the object has slipped."""
        return self.slip_deviations > self._most

    def follow(
        self, config: Configuration, elapsed: float, pressures: Pressures, rollers: Readings = None
    ) -> HoldStatus:
        """
        Roll the equilibrium to the current configuration; return the new hold status.

        Within `EQUILIBRIUM_PERIOD` of the last equilibrium, pose and squeeze are predicted
        instead. If a contact slips or opens in the model, the equilibrium near the estimated pose
        is searched once.

        :param elapsed: time since the last call [s].
        :param rollers: readings from which the configuration was predicted; None: the
            configuration is measured.
        """
        cache, lag, state = self.cache, self.lag, self.state
        lag.time += elapsed
        since_rolled = lag.time - self._rolled
        has_corrections = bool(cache.moved_zeros.any())
        travel, is_predictable = cache.predict(config)
        predicted = cache.ahead[:3]
        measured, age = rollers or (config.roller_positions, 0.0)
        since_measured = cache.travel_rates[:3] @ (config.roller_positions - measured)
        is_early = since_rolled < EQUILIBRIUM_PERIOD - ROUNDING
        if is_early and is_predictable and not has_corrections:
            lag.record(lag.travelled + predicted, since_measured, age)
            return HoldStatus.HELD
        rolled = cache.roll(config, pressures)
        hold = HoldStatus.NO_BALANCE if rolled is None else self._hold(rolled)
        if rolled is None or hold not in (HoldStatus.HELD, HoldStatus.SLIPS):
            lag.way.add(lag.time, lag.travelled)  # the object has not moved
            return HoldStatus.HELD if self.attach(config, pressures) else hold
        change = pose_difference(np.append(rolled.pose, rolled.squeeze), cache.outputs)
        moved = change[:3]
        if has_corrections:
            # Corrections of offsets do not move the object; the unexplained pose changes instead.
            state.bias, moved = state.bias - self._even * (moved - predicted), predicted
        else:
            cache.learn(rolled, travel, change, since_rolled)
        lag.travelled = lag.travelled + moved
        lag.record(lag.travelled, since_measured, age)
        self.take(rolled)
        decayed = state.propagate(since_rolled, self._even * moved, np.abs(travel), cache)
        lag.hold_back(cache.rates[:, LOAD] @ decayed / cache.scale)
        # After large corrections the rates are invalid.
        is_due = np.abs(self._corrected).max() > MAX_FIRST_ORDER_TRAVEL
        # An earlier search would attribute transient loads to the contacts.
        may_search = lag.time - self._searched > self.settings.load_time and not self.is_assumed
        if is_due or (may_search and rolled.required_friction > self._friction):
            self.attach(config, pressures)
        return HoldStatus.HELD  # slip is detected from the poses

    def observe(self, pose: Pose, age: float) -> None:
        """
        Update the belief of the grip with a measured pose.

        :param age: time from the stamp of the pose to the last call of `follow` [s].
        """
        cache, lag, even = self.cache, self.lag, self._even
        time = lag.time - age - self.state.delay
        by_rollers = lag.way.at(time)
        # Earlier readings: their encoder noise is independent of that in the innovation.
        earlier, later = (lag.way.at(time - n * DELAY_DEVIATION) for n in (2, 1))
        velocity = (later - earlier) / DELAY_DEVIATION
        expected = self.pose - pose_difference(lag.way.last[1], by_rollers)
        innovation = even * pose_difference(pose, expected)
        self.state.noise.add(even * pose_difference(pose, by_rollers))
        outputs_before = self.outputs
        change = self.state.correct(innovation, even * velocity, cache, lag.time)
        cache.shift(change[SHIFTS:])
        lag.hold_back(self.outputs - outputs_before)

    def attach(self, config: Configuration, pressures: Pressures) -> bool:
        """
        Search the equilibrium near the estimated pose, and initialise the contacts' shifts there.

        :return: whether an equilibrium exists that explains the pose, with a utilisation of at
            most `MAX_UTILISATION` or that of the present equilibrium.
        """
        self._searched = self.lag.time
        limit = max(MAX_UTILISATION, self.grasp.sections.used.max())
        pose, squeeze = self.pose - self.grasp.response.pose @ self.state.load, self.squeeze
        grip = self._given.moved_to(pose)
        try:
            held = attach_model(config, grip, pressures, self.settings.zero_deviation)
        except NotHeldError:
            return False
        if held.hold(math.inf) is not HoldStatus.HELD or held.sections.used.max() > limit:
            return False
        cache, rates_before = EquilibriumCache(held, self._friction), self.cache.by_offsets.outputs
        if not self.state.explains(pose, cache):
            return False
        self.is_assumed, self.cache = False, cache
        self._fit_state()
        self.state.walk.attach((cache.by_offsets.outputs - rates_before)[:3])
        self._corrected = np.zeros_like(self._corrected)
        self._start_at(pose)
        self.lag.hold_back(np.append(np.zeros(3), self.squeeze - squeeze))
        return True

    def _start_at(self, pose: Array) -> None:
        """
        Initialise the state with a pose (3,) without load [m, rad].

        The contacts are shifted toward it within friction, unless the equilibrium is assumed; the
        distance that remains is the unexplained pose.
        """
        cache, grasp, friction, self._spare = self.cache, self.grasp, self._friction, 0.0
        shifts = np.zeros(len(grasp.members))
        # The second step has the derivatives at the first solution.
        for _ in range(0 if self.is_assumed else 2):
            gain = self.state.initialise(cache, friction)
            off = self._even * pose_difference(pose, self.grasp.pose)
            moved = (gain @ (off + cache.rates[:3, SHIFTS:] @ shifts))[SHIFTS:] - shifts
            by_contact = moved[cache.grasp.contacts.owners]
            placed = cache.roll(grasp.config, grasp.pressures, by_contact)
            # Forces beyond friction and contacts of other members are attributed to wrong offsets,
            # so the shifts are not applied.
            if placed is None or len(placed.members) != len(shifts):
                break
            if self._hold(placed) is not HoldStatus.HELD:
                break
            shifts = shifts + moved
            self._spare = grasp.slip_margin(friction) - placed.slip_margin(friction)
            self.take(placed)
        self.state.bias = self._even * pose_difference(pose, self.grasp.pose)
        self.state.initialise(cache, friction)

    def _hold(self, grasp: HeldGrip) -> HoldStatus:
        """Return the hold status of an equilibrium; `UNSTABLE` if it has no response to loads."""
        if grasp.response is None:
            return HoldStatus.UNSTABLE
        return grasp.hold((1.0 + 2.0 * self.settings.squeeze_error) * self._friction)

    def correct_zeros(self, moved: Array) -> None:
        """
        Increase the roller offsets by `moved` (r,) without changing the object's pose [m].

        The next equilibrium contains the correction; until then the squeeze follows to first
        order.
        """
        self.cache.correct_zeros(moved, self.state.sensitivity, SHIFTS)
        self._corrected = self._corrected + moved

    def take(self, grasp: HeldGrip) -> None:
        """Set the equilibrium, for example one that another belief has found."""
        self.cache.take(grasp)
        self._fit_state()

    def _fit_state(self) -> None:
        """Give the state the size of the derivatives at an equilibrium that is new."""
        self._rolled = self.lag.time
        size = self.cache.rates.shape[1]
        if size != len(self.state.covariance):
            self.state.resize(size, SHIFTS, self.grasp.arm**2)
