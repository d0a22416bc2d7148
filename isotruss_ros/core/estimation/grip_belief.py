# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Gaussian belief of the grip: a Kalman filter about the equilibrium of the held object.

The contacts roll with the tubes, so the equilibrium follows the configuration. Measured poses
correct four states: the load w, which is an external wrench; the shift a of the contacts along the
members; the unexplained pose b, which is measured minus modelled; and the delay of the poses. The
roller offsets dphi are considered: they are uncertain, but poses do not correct them. With the
roller positions q, the compliance C and white noise v, the measured pose is

    e = (w, b, a, delay | dphi),   z = equilibrium(q + dphi, a) + C w + b + v

The stiffness of the tubes is no state: it scales all forces and moves nothing.
"""

from __future__ import annotations

from dataclasses import replace
import math

from isotruss_ros.core.estimation.contact_walk import ContactWalk
from isotruss_ros.core.estimation.grip_model import (
    anchor_rates,
    attach_model,
    BIAS,
    ConsideredRates,
    DELAY,
    LOAD,
    MAX_UTILISATION,
    Pressures,
    shift_deviations,
    SHIFTS,
    StateRates,
)
from isotruss_ros.core.estimation.offset_filter import SLIP_LENGTH
from isotruss_ros.core.estimation.pose_noise import MODEL_ERROR, PoseNoise, PRIOR_DEVIATIONS
from isotruss_ros.core.estimation.schmidt_filter import SchmidtFilter
from isotruss_ros.core.estimation.state_estimate import EstimatorSettings, MAX_KNOWN_DEVIATION
from isotruss_ros.core.holding.held_grip import (
    HeldGrip,
    HoldStatus,
    MAX_EXTRAPOLATION,
    NotHeldError,
    travel_rates,
)
from isotruss_ros.core.holding.roll_grip import roll_grip, with_pressures
from isotruss_ros.core.inputs import MAX_TIMEOUT, Timeline
from isotruss_ros.core.kinematics.configuration import Configuration, MAX_FIRST_ORDER_TRAVEL
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.model.pose import Pose, pose_difference
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.tolerances import ROUNDING
from isotruss_ros.core.safety.usage_limits import UsageLimits
import numpy as np

#: Random walk of the unexplained pose as a fraction of the object's motion, with the correlation
#: length `SLIP_LENGTH` [-].
POSE_WALK = 0.03
#: Prior standard deviation of the time by which poses are older than their stamps say, and
#: interval over which the object's velocity is measured [s].
DELAY_DEVIATION = 0.03
#: Number of poses after which the equilibrium is searched again [-].
FIRST_POSES = 15
#: Smallest time between two equilibria [s]. In cycles between them, (19) predicts pose and
#: squeeze, and the error of this prediction in the last motion is extrapolated.
EQUILIBRIUM_PERIOD = 0.02
#: Number of standard deviations [-]: a pose is inconsistent if its innovation is larger (one of
#: 60000 valid poses is), and contacts have slipped if corrections and load are larger.
MAX_DEVIATIONS = 5.0


class GripBelief:
    """
    Belief of a held object: an equilibrium of the model, corrected by measured poses.

    :ivar grasp: equilibrium without a load, in the current configuration.
    :ivar grip: grip from which (19) predicts the motion of the object, see `HeldGrip.touching`.
    :ivar load: estimated external wrench (fx, fy, m / arm) on the object [N]; arm is its
        characteristic radius.
    :ivar bias: (3,) part of the pose that the model does not explain: measured minus modelled
        pose, rotations times the arm [m].
    :ivar delay: time by which the measured poses are older than their stamps say [s].
    :ivar innovation: normalised squared innovation (3 degrees of freedom) of the last pose [-].
    :ivar drift: (4,) rates of pose [m/s, rad/s] and squeeze [N/s] between the last two equilibria,
        minus those predicted by (19).
    :ivar usage: limits on motion that reduces the slip margin or increases the utilisation.
    :ivar walk: sums of the pose corrections, from which slip is detected.
    :ivar jump: length of the last innovation if it was inconsistent, otherwise 0 [m].
    :ivar searches: number of searches for an equilibrium with unknown contact history [-].
    :param grasp: equilibrium near the measured pose, see `attach_model`.
    :param grip: grip with the object at its measured pose.
    :param settings: prior standard deviations.
    :param zero_covariance: (r, r) covariance of the roller offsets [m^2]; None: uncorrelated
        offsets with the standard deviation of the settings.
    :param noise: (3,) prior standard deviations of the measured poses [m, rad].
    :param is_assumed: whether the object is assumed to be held, because only wrong roller offsets
        can explain the measured pose.
    """

    # Corrections since the last equilibrium, see `_take`.
    _anchors: Array
    _anchored: Array
    _pending: Array
    _pending_forces: Array
    _moved_zeros: Array

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
        self._even = np.array([1.0, 1.0, grasp.arm])
        count, shifts = len(grasp.config.roller_positions), len(grasp.members)
        variances = np.zeros(SHIFTS + shifts)
        variances[DELAY] = DELAY_DEVIATION**2
        if zero_covariance is None:
            zero_covariance = settings.zero_deviation**2 * np.eye(count)
        self._filter = SchmidtFilter(variances, zero_covariance)
        self.load, self.delay = np.zeros(3), 0.0
        self.innovation, self.jump, self.searches = 0.0, 0.0, 0
        self.bias = np.zeros(3)
        self.walk, self.noise = ContactWalk(), PoseNoise(self._even * noise)
        self._time, self._way, self._poses = 0.0, Timeline(), 0
        self._searched = self._rolled = 0.0  # times of the last search and equilibrium
        self._corrected = np.zeros(count)
        self._travelled = np.array(grasp.pose)  # pose by roller travel alone
        self._measured = 0.0, self._travelled  # time of the last measured rollers, and pose then
        self._way.add(*self._measured)
        # Corrections of pose [m, m, rad] and squeeze [N] in the two low-pass filters in series.
        self._lag = np.zeros((2, 4))
        self._by_considered = ConsideredRates.of(grasp)
        self._take(grasp)
        self._forget_motion(grasp)
        self._spare = 0.0  # slip margin lost by the contact history [N]
        if is_assumed:
            self._initialise()
            self.bias = self._even * pose_difference(grip.body.pose, grasp.pose)
        else:
            self._place_contacts(np.array(grip.body.pose))

    @property
    def pose(self) -> Array:
        """Return the estimate (x, y, angle) of the object's pose [m, rad]."""
        give = self.grasp.response.pose @ self.load
        known = np.array(self.grasp.pose) + self._ahead[:3] + self._pending[:3]
        return known + give + self.bias / self._even

    @property
    def squeeze(self) -> float:
        """Return the estimated mean normal force of the members [N]."""
        give = self.grasp.response.squeeze @ self.load
        return self.grasp.squeeze + float(self._ahead[3] + self._pending[3] + give)

    @property
    def differentiated(self) -> HeldGrip:
        """Return the equilibrium at which the filter's Jacobian was computed."""
        return self._by_considered.grasp

    @property
    def geometric_deviation(self) -> float:
        """
        Return the standard deviation of the squeeze for the stiffness of the robot file [N].

        It includes the model error.
        """
        variance = self._filter.spread(self._rates.squeeze, self._by_considered.squeeze)
        return math.sqrt(variance + (self.settings.squeeze_error * self.squeeze) ** 2)

    @property
    def squeeze_deviation(self) -> float:
        """Return the standard deviation of the squeeze, with model and stiffness errors [N]."""
        return math.hypot(self.geometric_deviation, self.settings.stiffness * self.squeeze)

    @property
    def squeeze_is_unknown(self) -> bool:
        """Return whether the relative deviation of the squeeze exceeds `MAX_KNOWN_DEVIATION`."""
        return self.squeeze_deviation > MAX_KNOWN_DEVIATION * self.squeeze

    @property
    def largest_friction(self) -> float:
        """
        Return the largest required friction at which an equilibrium still counts as held [-].

        It exceeds the coefficient of friction by two relative standard deviations of the squeeze,
        for the given stiffness, which does not change the required friction.
        """
        relative = 2.0 * self.geometric_deviation
        return self._friction * (1.0 + relative / self.squeeze) if self.squeeze > 0.0 else math.inf

    @property
    def pose_covariance(self) -> Array:
        """Return the covariance of the object's pose, (3, 3) [m^2, m rad, rad^2]."""
        spread = self._filter.spread(self._rates.pose, self._by_considered.pose)
        return spread / np.outer(self._even, self._even)

    def explains(self, pose: Pose) -> bool:
        """
        Return whether load and errors of offsets and measurement suffice to explain a pose.

        :param pose: measured pose of the object.
        """
        off = self._even * pose_difference(pose, self.grasp.pose)
        rates, noise = self._by_considered.pose, np.diag(self.noise.variances)
        give = self._rates.pose[:, LOAD] * self.settings.load
        spread = rates @ self._filter.considered @ rates.T + give @ give.T + noise
        return float(off @ np.linalg.solve(spread, off)) <= MAX_DEVIATIONS**2

    def joint_rates(self) -> Array:
        """
        Return the derivatives (2j, r) of the joint positions with respect to roller offsets.

        The object's pose is held constant.
        """
        return self._by_considered.joint_rates(self._filter.sensitivity[SHIFTS:])

    @property
    def correction(self) -> Array:
        """Return the part (3,) of the pose that roller travel does not explain, see `bias` [m]."""
        return self._even * pose_difference(self.pose, self._way.last[1])

    @property
    def regulated_pose(self) -> Array:
        """Return the object's pose (3,) for control, with corrections smoothed by two filters."""
        return self.pose - self._lag[:, :3].sum(axis=0)

    @property
    def regulated_squeeze(self) -> float:
        """Return the squeeze for control, with corrections smoothed by two filters [N]."""
        return self.squeeze - float(self._lag[:, 3].sum())

    @property
    def slip_margin(self) -> float:
        """
        Return the object's slip margin without load and for unknown contact history [N].

        The contact history is ignored because an object that has slid into place uses all of its
        friction and is held nevertheless: if it slips further, it reaches the equilibrium of
        `attach_grip`.
        """
        return self._margin(self.grasp, self._pending_forces) + self._spare

    @property
    def slip_deviations(self) -> float:
        """
        Return the norm of pose corrections, load and delay in standard deviations [-].

        The standard deviation of the load is set to at least half of the slip margin, because a
        load within the margin causes no slip.
        """
        least = max(self.settings.load, 0.5 * self.slip_margin)
        delayed = self.delay / DELAY_DEVIATION
        return math.hypot(self.walk.deviations, delayed, *(self.load / least))

    @property
    def slipped(self) -> bool:
        """Return whether `slip_deviations` are so large that the object has slipped."""
        return self.slip_deviations > self._most

    @property
    def slope(self) -> float:
        """Return the derivative of the squeeze with respect to the opening of the grip [N/m]."""
        return self.grasp.squeeze_stiffness()

    def follow(
        self,
        config: Configuration,
        elapsed: float,
        pressures: Pressures,
        rollers: tuple[Array, float] | None = None,
    ) -> HoldStatus:
        """
        Roll the equilibrium to the current configuration; return the new hold status.

        Within `EQUILIBRIUM_PERIOD` of the last equilibrium, pose and squeeze are predicted
        instead. If a contact slips or opens in the model, the equilibrium near the estimated pose
        is searched once.

        :param config: configuration of the robot, which may be predicted.
        :param elapsed: time since the last call [s].
        :param pressures: (t,) gauge pressure of each tube [Pa]; None: as in the robot file.
        :param rollers: (r,) measured roller positions from which the configuration was predicted
            [m], and their age [s]; None: the configuration is measured.
        """
        before, self._time = self.grasp, self._time + elapsed
        elapsed, corrected = self._time - self._rolled, bool(self._moved_zeros.any())
        travel = config.roller_positions - before.config.roller_positions - self._moved_zeros
        moved, known = self._contact_rates @ travel, self._motion
        share = float(travel @ known) / max(float(known @ known), MODEL_ERROR**2)
        near = abs(share) <= MAX_EXTRAPOLATION
        share = max(-MAX_EXTRAPOLATION, min(share, MAX_EXTRAPOLATION))
        self._ahead = np.append(moved[:3], self.slope * moved[3]) + share * self._beyond
        ahead = self._ahead[:3]
        if elapsed < EQUILIBRIUM_PERIOD - ROUNDING and near and not corrected:
            self._record(self._travelled + ahead, config, rollers)
            return HoldStatus.HELD
        given = replace(with_pressures(before, pressures), anchors=self._anchors)
        rolled = roll_grip(given, config)
        hold = HoldStatus.NO_BALANCE if rolled is None else self._hold(rolled)
        if rolled is None or hold not in (HoldStatus.HELD, HoldStatus.SLIPS):
            self._way.add(self._time, self._travelled)
            return HoldStatus.HELD if self.attach(config, pressures) else hold
        change = pose_difference(rolled.pose, np.array(before.pose) + self._pending[:3])
        if corrected:
            # Corrections of offsets do not move the object; the unexplained pose changes instead.
            self.bias, change = self.bias - self._even * (change - ahead), ahead
        else:
            self._learn(before, rolled, travel, change, elapsed, moved)
        self._travelled = self._travelled + change
        self._record(self._travelled, config, rollers)
        self._take(rolled)
        self._predict(elapsed, self._even * change, np.abs(travel))
        # The first equilibrium used one noisy pose; after large corrections the rates are invalid.
        due = self._poses == FIRST_POSES or np.abs(self._corrected).max() > MAX_FIRST_ORDER_TRAVEL
        self._poses += due
        # An earlier search would attribute transient loads to the contacts.
        waited = self._time - self._searched > self.settings.load_time
        slips = rolled.required_friction > self._friction and waited
        if due or slips:
            self.attach(config, pressures)
        return HoldStatus.HELD  # slip is detected from the poses

    def _record(
        self, travelled: Array, config: Configuration, rollers: tuple[Array, float] | None
    ) -> None:
        """Store the pose (3,) by roller travel alone, now and at the last measured rollers."""
        positions, age = rollers or (config.roller_positions, 0.0)
        ahead = self._contact_rates[:3] @ (config.roller_positions - positions)
        # The last call's prediction is replaced, because rollers may follow their commands late.
        self._way.add(*self._measured)
        self._measured = self._time - age, travelled - ahead
        self._way.add(*self._measured)
        self._way.add(self._time, travelled)
        self._way.discard_before(self._time - MAX_TIMEOUT)

    def observe(self, pose: Pose, age: float) -> None:
        """
        Update the belief of the grip with a measured pose.

        :param pose: measured pose of the object.
        :param age: time from the stamp of the pose to the last call of `follow` [s].
        """
        self._poses += self._poses != FIRST_POSES
        then = self._time - age - self.delay
        there = self._way.at(then)
        # Earlier readings: their encoder noise is independent of that in the innovation.
        first, last = (self._way.at(then - n * DELAY_DEVIATION) for n in (2, 1))
        speed = (last - first) / DELAY_DEVIATION
        expected = self.pose - pose_difference(self._way.last[1], there)
        off = self._even * pose_difference(pose, expected)
        self.noise.add(self._even * pose_difference(pose, there))
        rates = self._rates.pose.copy()
        rates[:, DELAY] = -self._even * speed
        noise = np.diag(self.noise.variances)
        self._correct(off, rates, noise)

    def attach(self, config: Configuration, pressures: Pressures) -> bool:
        """
        Search the equilibrium near the estimated pose, and initialise the contacts' shifts there.

        :param config: configuration of the robot.
        :param pressures: (t,) gauge pressure of each tube [Pa]; None: as in the robot file.
        :return: whether an equilibrium exists, with a utilisation of at most `MAX_UTILISATION` or
            that of the present equilibrium.
        """
        self.searches, self._searched = self.searches + 1, self._time
        limit = max(MAX_UTILISATION, self.grasp.sections.used.max())
        pose, squeeze = self.pose - self.grasp.response.pose @ self.load, self.squeeze
        try:
            near = self._given.moved_to(pose)
            found = attach_model(config, near, pressures, self.settings.zero_deviation)
        except NotHeldError:
            return False
        if found.hold(math.inf) is not HoldStatus.HELD or found.sections.used.max() > limit:
            return False
        before = self._by_considered.pose
        self._take(found)
        self.walk.attach(self._by_considered.pose - before)
        self._forget_motion(found)
        self._corrected = np.zeros_like(self._corrected)
        self._place_contacts(pose)
        self._lag[0, 3] += self.squeeze - squeeze
        return True

    def _place_contacts(self, pose: Array) -> None:
        """
        Initialise the shifts of the contacts from a pose, independently of load and offsets.

        As much of the pose as possible is attributed to the shifts; the rest is the unexplained
        pose.

        :param pose: (3,) pose of the object without load [m, rad].
        """
        grasp, self._spare = self.grasp, 0.0
        shifts = np.zeros(len(grasp.members))
        for _ in range(2):  # the second step has the derivatives at the first solution
            gain, known = self._initialise(), self.grasp
            off = self._even * pose_difference(pose, known.pose)
            moved = (gain @ (off + self._rates.pose[:, SHIFTS:] @ shifts))[SHIFTS:] - shifts
            anchors = known.anchors + moved[known.contacts.owners]
            shifts, placed = (
                shifts + moved,
                roll_grip(replace(known, anchors=anchors), known.config),
            )
            # Forces beyond friction are attributed to wrong offsets, so the shifts are not
            # applied.
            if placed is None or self._hold(placed) is not HoldStatus.HELD:
                break
            self._spare = self._margin(grasp) - self._margin(placed)
            self._take(placed)
        self._initialise()
        self.bias = self._even * pose_difference(pose, self.grasp.pose)

    def _initialise(self) -> Array:
        """Set the state's prior covariance, and update it for a pose; return the gain (n, 3)."""
        known, given = self._filter, self.settings
        shifts = shift_deviations(self.grasp, self._anchored, self._friction)
        variances = np.diag(known.covariance).copy()
        variances[LOAD], variances[BIAS] = given.load**2, given.pose_error**2
        variances[SHIFTS:] = shifts**2
        known.reset(np.diag(variances))
        # The part of the pose that shifts within friction do not explain: roller offsets.
        rates, by_considered = self._rates.pose, self._by_considered.pose
        shifted = rates[:, SHIFTS:] * variances[SHIFTS:] @ rates[:, SHIFTS:].T
        own = given.pose_error**2 * np.eye(3)
        left = np.linalg.solve(shifted + own, own).T @ by_considered
        known.covariance[BIAS, BIAS] += left @ known.considered @ left.T
        return known.condition(rates, by_considered, np.diag(self.noise.variances))

    def _hold(self, grasp: HeldGrip) -> HoldStatus:
        """Return the hold status of an equilibrium; `UNSTABLE` if it has no response to loads."""
        if grasp.response is None:
            return HoldStatus.UNSTABLE
        return grasp.hold((1.0 + 2.0 * self.settings.squeeze_error) * self._friction)

    def set_zero_covariance(self, covariance: Array) -> None:
        """
        Replace the covariance of the considered roller offsets.

        :param covariance: (r, r) covariance of the roller offsets [m^2].
        """
        self._filter.considered = covariance

    def correct_zeros(self, moved: Array) -> None:
        """
        Correct the roller offsets without changing the object's pose.

        The next equilibrium contains the correction; until then the squeeze follows to first
        order.

        :param moved: (r,) increases of the roller offsets, and thus of the roller positions [m].
        """
        grasp = self.grasp
        travel = travel_rates(grasp.config, grasp.contacts.members) @ moved
        shifts = self._filter.sensitivity[SHIFTS:] @ moved
        self._anchors = self._anchors + grasp.statics.sides * travel
        self._anchors = self._anchors + shifts[grasp.contacts.owners]
        self._moved_zeros = self._moved_zeros + moved
        rates = self._by_considered.squeeze + self._rates.squeeze @ self._filter.sensitivity
        self._ahead = self._ahead + np.append(np.zeros(3), rates @ moved)
        self._corrected = self._corrected + moved

    def _correct(self, off: Array, rates: Array, noise: Array) -> None:
        """Update the belief with the innovation (3,) of a measured pose [m]."""
        prior, walking = self._filter.covariance, np.zeros_like(rates)
        walking[:, BIAS], walking[:, SHIFTS:] = rates[:, BIAS], rates[:, SHIFTS:]
        unsure = walking @ prior @ walking.T
        spread = rates @ prior @ rates.T + noise
        self.innovation, self.jump = float(off @ np.linalg.solve(spread, off)), 0.0
        if self.innovation > MAX_DEVIATIONS**2:  # contacts and unexplained pose may be anywhere
            self.jump = math.hypot(*off)
            freed = np.zeros(len(prior))
            freed[BIAS] = freed[SHIFTS:] = self.jump**2
            self._filter.covariance = prior + np.diag(freed)
        change = self._filter.condition(rates, self._by_considered.pose, noise) @ off
        delay = self.delay + float(change[DELAY])
        self.delay = min(max(delay, 0.0), MAX_DEVIATIONS * DELAY_DEVIATION)
        self._shift(change)
        give = self._rates.pose[:, LOAD] * self.settings.load
        self.walk.add(
            self._time,
            walking @ change,
            unsure,
            noise + give @ give.T,
            self._by_considered.pose,
            self._filter.considered,
        )

    def _shift(self, change: Array) -> None:
        """Apply a correction (n,) of the state; the equilibrium follows in the next cycle."""
        grasp, places = self.grasp, self.grasp.state.places
        shifts = change[SHIFTS:][grasp.contacts.owners]
        moved = self._anchored @ shifts
        squeeze = moved[places.normal].sum() / len(grasp.members)
        self._anchors = self._anchors + shifts
        self._pending = self._pending + np.append(moved[:3], squeeze)
        self._pending_forces = self._pending_forces + moved[-2 * len(shifts) :]  # noqa: E203
        self.load, self.bias = self.load + change[LOAD], self.bias + change[BIAS]
        given = moved[:3] + grasp.response.pose @ change[LOAD] + change[BIAS] / self._even
        pressed = squeeze + float(grasp.response.squeeze @ change[LOAD])
        self._lag[0] += np.append(given, pressed)

    def _predict(self, elapsed: float, moved: Array, travel: Array) -> None:
        """Propagate the covariance of the grip's state by process noise."""
        given = self.settings
        left = math.exp(-elapsed / given.load_time)
        more, kept = np.zeros_like(self._rates.squeeze), np.ones_like(self._rates.squeeze)
        kept[LOAD] = left
        more[BIAS] = POSE_WALK**2 * SLIP_LENGTH * math.hypot(*moved)
        more[SHIFTS:] = given.slip**2 * SLIP_LENGTH * travel.max()
        self.walk.spread(self._rates.pose * more @ self._rates.pose.T)
        more[LOAD] = given.load**2 * (1.0 - left**2)
        self._filter.predict(kept, more)
        considered = self._filter.considered
        self._filter.considered = considered + np.diag(given.slip**2 * SLIP_LENGTH * travel)
        decayed, response = (left - 1.0) * self.load, self.grasp.response
        self._lag[0] += np.append(response.pose @ decayed, response.squeeze @ decayed)
        self.load = self.load + decayed

    def pass_corrections(self, elapsed: float, filter_time: float) -> None:
        """
        Advance the two low-pass filters through which pose and squeeze corrections pass.

        :param elapsed: time since the last call [s].
        :param filter_time: time constant of the low-pass filters [s].
        """
        left = math.exp(-elapsed / filter_time)
        self._lag[1] += (1.0 - left) * self._lag[0]
        self._lag *= left

    def _take(self, grasp: HeldGrip) -> None:
        """Set the equilibrium, and the Jacobian of the measured pose at this equilibrium."""
        self.grasp, self.grip = grasp, grasp.touching(self._friction)
        self._contact_rates, self._rolled = grip_jacobian(grasp.config, self.grip), self._time
        self._ahead = np.zeros(4)  # predicted changes since this equilibrium
        # Corrections of the contacts that the equilibrium does not contain yet.
        self._anchors = grasp.anchors
        self._pending = np.zeros(4)
        self._moved_zeros = np.zeros(len(grasp.config.roller_positions))
        self._pending_forces = np.zeros(2 * len(grasp.anchors))
        self._anchored = anchor_rates(grasp)
        self._rates = StateRates.of(grasp, self._anchored)
        size, known = len(self._rates.squeeze), self.differentiated
        if size != len(self._filter.covariance):
            self._filter.resize(size, SHIFTS, grasp.arm**2)
        moved = grasp.config.roller_positions - known.config.roller_positions
        far = known.contacts is not grasp.contacts
        if far or np.abs(moved).max() > MAX_FIRST_ORDER_TRAVEL:
            self._by_considered = ConsideredRates.of(grasp)

    def _margin(self, grasp: HeldGrip, more: Array | None = None) -> float:
        """Return the object's slip margin under additional contact forces (2k,) [N]."""
        reserve, _, size = grasp.slip_reserves(self._friction)
        if more is not None:
            reserve = reserve + grasp.slip_rows(self._friction)[0] @ more
        return float((reserve / size).min())

    def _forget_motion(self, grasp: HeldGrip) -> None:
        """Reset the quantities that are derived from the last motion, at a new equilibrium."""
        self.usage, self.drift = UsageLimits(grasp), np.zeros(4)
        #: Roller travel of the last motion, and errors of the predicted pose and squeeze.
        self._motion, self._beyond = np.zeros_like(self._corrected), np.zeros(4)

    def _learn(
        self,
        before: HeldGrip,
        grasp: HeldGrip,
        travel: Array,
        change: Array,
        elapsed: float,
        moved: Array,
    ) -> None:
        """Compute `drift`, and the derivatives of slip margin and utilisation by roller travel."""
        if grasp.contacts is not before.contacts:  # a discontinuity
            self._forget_motion(grasp)
            return
        pressed = grasp.squeeze - before.squeeze - self._pending[3]
        pressed -= before.squeeze_stiffness() * moved[3]
        self._motion, self._beyond = travel, np.append(change - moved[:3], pressed)
        self.drift = self._beyond / elapsed if elapsed > 0.0 else np.zeros(4)
        was = self._margin(before, self._pending_forces)
        self.usage.learn(grasp, grasp.slip_margin(self._friction) - was, travel)
