# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Last equilibrium of a grip, and its prediction."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
import math
from typing import Any, NamedTuple

from isotruss_ros.core.holding.attach_grip import attach_grip, lay_faces
from isotruss_ros.core.holding.contact_search import measure_gaps
from isotruss_ros.core.holding.grasp_gradient import held_gradient
from isotruss_ros.core.holding.grip_response import slip_planes
from isotruss_ros.core.holding.held_grip import HeldGrip, HoldStatus, NotHeldError
from isotruss_ros.core.holding.held_shape import lowest_frequency
from isotruss_ros.core.holding.newton import Accuracy
from isotruss_ros.core.holding.roll_grip import begin_roll, roll_grip, with_tubes
from isotruss_ros.core.kinematics.configuration import Configuration, MAX_FIRST_ORDER_TRAVEL
from isotruss_ros.core.manipulation.grip import find_members, Grip
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.records import replace
from isotruss_ros.core.numerics.work_limit import WorkLimitError
from isotruss_ros.core.safety.usage_limits import UsageLimits
import numpy as np

# Model of a held object: its equilibrium, and the linearisation of pose and squeeze.
#
# The state is (load, unexplained pose, delay, shifts of the contacts along the members); the
# parameters are the roller offsets, see `grip_belief`. The outputs are the object's pose and the
# squeeze.

#: Indices of load, unexplained pose and delay in the state, and first index of the contacts'
#: shifts.
LOAD, BIAS, DELAY, SHIFTS = slice(0, 3), slice(3, 6), 6, 7
#: Largest utilisation of an equilibrium that is searched near a measured or estimated pose [-].
#: There, the moment in the model exceeds that of a wrinkled tube by 5 % (Comer and Levy, see
#: `core.statics.wrinkling`); at 1.5 it exceeds it by 15 %.
MAX_UTILISATION = 1.2
#: Accuracy of a tracked equilibrium. In 121 equilibria of 6 runs with discs and boxes, with loads,
#: noise and wrong offsets, poses err by at most 1.3 um (median 0.1 um), squeezes and slip margins
#: by at most 2 mN, and the squeeze's derivative by opening by at most 0.4 %.
TRACKED = Accuracy(2e-4, 1e7)
#: Gauge pressure of each tube (t,) [Pa]; None: as in the robot file.
Pressures = tuple[float, ...] | None


def attach_model(
    config: Configuration, grip: Grip, pressures: Pressures = None, zero_deviation: float = 0.0
) -> HeldGrip:
    """
    Return the object's equilibrium near its measured pose, with a `response` to wrenches.

    For the deviation of the roller offsets [m] see `lay_faces`.
    """
    members = find_members(config.robot.topology, grip.members).members
    held = attach_grip(config, grip.body, members, pressure=pressures, quick=True)
    held = lay_faces(held, grip.friction, zero_deviation)
    if held.response is None:
        raise NotHeldError(HoldStatus.UNSTABLE)
    return held


def shift_deviations(held: HeldGrip, by_shifts: Array, friction: float) -> Array:
    """
    Return the prior deviations (m,) of the contacts' shifts along the members [m].

    A deviation is twice the shift that causes slip, at most the object's characteristic radius.
    For `by_shifts` see `shift_rates`.
    """
    reserve = friction * held.normal_forces - np.abs(held.friction_forces)
    reserve = np.maximum(reserve, 0.1 * friction * held.squeeze)
    # Derivatives (m, m) of the members' friction forces by the members' shifts.
    friction_rates = held.contacts.sum_by_member(by_shifts[held.state.places.friction])
    stiffness = np.abs(np.diag(friction_rates))
    smallest_stiffness = 2.0 * reserve / held.arm
    return 2.0 * reserve / np.maximum(stiffness, smallest_stiffness)


def output_scale(held: HeldGrip) -> Array:
    """Return the scale factors (4,) of pose and squeeze: the arm [m] for rotation, else 1."""
    return np.array([1.0, 1.0, held.arm, 1.0])


def output_change(held: HeldGrip, unknowns: Array) -> Array:
    """Return changes (4, ...) of pose and squeeze by those of the unknowns (3 + 4k, ...)."""
    squeeze = unknowns[held.state.places.normal].sum(axis=0) / len(held.members)
    return np.concatenate([unknowns[:3], squeeze[None]])


def shift_rates(held: HeldGrip) -> Array:
    """Return derivatives (3 + 4k, m) of pose, contact points and forces by the members' shifts."""
    places, owners = held.state.places, held.contacts.owners
    # A shift of a member's contacts changes the rolling condition of each of them.
    changes = np.zeros((places.size, len(held.members)))
    changes[places.conditions] = -np.eye(len(held.members))[owners]
    return held.respond(changes)


def state_rates(held: HeldGrip, by_shifts: Array) -> Array:
    """Return derivatives (4, n) of scaled pose and squeeze by the state; see `shift_rates`."""
    # Columns: derivatives of pose and contact forces by the load, and by the members' shifts.
    unknowns = np.hstack([held.response.change, by_shifts])
    outputs = output_scale(held)[:, None] * output_change(held, unknowns)
    # Columns: derivatives by load, unexplained pose, delay, and shifts.
    return np.column_stack([outputs[:, :3], np.eye(4, 3), np.zeros(4), outputs[:, 3:]])


@dataclass(frozen=True, eq=False)
class OffsetRates:
    """Derivatives by r roller offsets, whose contacts rest on members, and natural frequency."""

    held: HeldGrip  #: equilibrium of the object
    outputs: Array  #: (4, r) derivatives of the scaled outputs
    by_travel: Array  #: (3 + 4k, r) derivatives of the unknowns by travel of rolling contacts
    joints: Array  #: (2j, r) derivatives of the joint positions (x0, y0, x1, y1, ...)
    joints_by_shifts: Array  #: (2j, m) derivatives of the joint positions by the members' shifts

    @classmethod
    def of(cls, held: HeldGrip) -> OffsetRates:
        """Return the derivatives by roller offsets at an equilibrium."""
        gradient, rollers = held_gradient(held), len(held.config.roller_positions)
        outputs = np.vstack([gradient.pose, gradient.normal_forces.mean(axis=0)])
        rates = np.vstack([output_scale(held)[:, None] * outputs, gradient.joints])
        by_rollers, by_anchors = np.split(rates, [rollers], axis=1)
        by_offsets = by_rollers + by_anchors @ held.anchor_rates
        shifts_of_contacts = np.eye(len(held.members))[held.contacts.owners]
        return cls(
            held,
            by_offsets[:4],
            gradient.unknowns[:, :rollers],
            by_offsets[4:],
            by_anchors[4:] @ shifts_of_contacts,
        )

    @cached_property
    def frequency(self) -> float | None:
        """Return the lowest natural frequency [rad/s], see `lowest_frequency`."""
        return lowest_frequency(self.held)


# Change of an equilibrium by roller travel, to second order along the last travel.

#: Travel between two equilibria below which their difference gives no derivatives [m]: unknowns
#: with errors of 0.1 um then have derivatives with errors of 0.1 %.
MIN_SECANT_TRAVEL = 2e-4


@dataclass(frozen=True, eq=False)
class TravelPrediction:
    """
    Prediction of the n unknowns of an equilibrium by the travel of r rollers since then.

    The derivatives at the equilibrium take long to compute. So they are those at an equilibrium
    nearby, and along the travel between two equilibria they are the secant, which holds halfway.
    The difference of two secants gives the second derivatives along the travel.

    :ivar rates: (n, r) derivatives by roller travel.
    :ivar direction: (r,) unit vector of the last travel between two equilibria.
    :ivar behind: travel in this direction from where the rates hold to the equilibrium [m].
    :ivar curvature: (n,) second derivatives in this direction.
    """

    rates: Array
    direction: Array
    behind: float
    curvature: Array

    @classmethod
    def of(cls, rates: Array) -> TravelPrediction:
        """Return the prediction of first order by the rates (n, r) at the equilibrium."""
        return cls(rates, np.zeros(rates.shape[1]), 0.0, np.zeros(len(rates)))

    def with_rates(self, rates: Array) -> TravelPrediction:
        """Return the prediction with the rates (n, r) at the equilibrium."""
        return replace(self, rates=rates, behind=0.0)

    def change(self, travel: Array) -> Array:
        """Return the changes (n,) of the unknowns by roller travel (r,) [m]."""
        along = float(self.direction @ travel)
        by_curvature = along * (self.behind + 0.5 * along) * self.curvature
        return self.rates @ travel + by_curvature

    def continued(self, travel: Array, change: Array) -> TravelPrediction:
        """Return the prediction at the equilibrium after a travel (r,) and a change (n,)."""
        length = math.hypot(*travel)
        behind = self.behind + float(self.direction @ travel)
        if length < MIN_SECANT_TRAVEL:
            return replace(self, behind=behind)
        direction = travel / length
        secant_change = change / length - self.rates @ direction
        rates = self.rates + np.outer(secant_change, direction)
        # The secant holds in the middle of the travel; after a turn back, the rates may as well.
        from_rates = self.behind * float(self.direction @ direction) + 0.5 * length
        curvature = np.zeros(len(rates))
        if from_rates >= 0.5 * length:
            curvature = secant_change / from_rates
        return TravelPrediction(rates, direction, 0.5 * length, curvature)


# Last equilibrium of the held object, with the changes of pose and squeeze since then.
#
# - `predicted` is the change by roller travel, because computing an equilibrium in each cycle
#   would
#   take too long. The next one is due if the error of the prediction may exceed a bound, see
#   `travel_limit`.
# - `drift` is the rate of the part of this change that (19) neglects, because commands that follow
#   from (19) must compensate it: the bending that (19) neglects is up to a tenth of the motion.
# - The work of an equilibrium is spread over cycles if no bound is exceeded thereby: a step of
#   Newton's method before it is due (`begun`), then the equilibrium in the configuration of this
#   step, then its utilisation, then the derivatives by offsets (`prepared`).
# - `outputs` contain the linear change by corrections of the contacts, because an estimate must
#   contain a measured pose at once, and the next equilibrium follows later.

#: Largest errors of the prediction of pose [m] and squeeze [N] between two equilibria.
MAX_ERRORS = np.array([5e-5, 0.1])
#: Bounds on the errors of pose [1/m] and squeeze [N/m^2] per square of the norm of the travel. In
#: 200 random motions of 40 random discs and boxes by 3 mm they were at most 1.9 and 3,730 (median
#: 0.8 and 13 for discs, 0.7 and 32 for boxes).
CURVATURES = np.array([2.0, 4e3])
#: Error of the linear change by shifts of the contacts, relative to this change [-]. In 79 random
#: shifts of the same objects by 0.3 mm it was at most 0.028.
SHIFT_SHARE = 0.03
#: Largest change of a corner's gap per norm of the travel [-]; at most 0.57 in 48 random motions.
GAP_RATE = 0.6
#: Largest error of the gap of a corner relative to it, which bounds the speed of landing [-].
GAP_SHARE = 0.05
#: Slip margin relative to the squeeze below which each motion needs an equilibrium [-]. At 213
#: equilibria of 8 carries with faults the margin was less than predicted, by at most 0.008 of the
#: squeeze in 99 %, and by 0.15 once.
NEAR_SLIP_SHARE = 0.05


class UsageError(NamedTuple):
    """Error of a predicted slip margin, from which `UsageLimits` learn when they follow."""

    margin_error: float  #: slip margin minus its prediction [N]
    travel: Array  #: (r,) travel of the prediction [m]


@dataclass(frozen=True, eq=False)
class EquilibriumCache:
    """
    Last equilibrium of a held object without a load, its derivatives, and changes since then.

    :ivar held: the equilibrium.
    :ivar grip: its contacts, from which (19) predicts the motion of the object.
    :ivar travel_rates: (4, r) derivatives of the outputs by roller travel, by (19).
    :ivar by_shifts: derivatives of its unknowns by the members' shifts, see `shift_rates`.
    :ivar scale: (4,) factors on the outputs in the following derivatives, see `output_scale`.
    :ivar rates: (4, n) derivatives of the outputs by the state.
    :ivar by_offsets: derivatives by roller offsets, also at an equilibrium nearby.
    :ivar by_travel: changes of the unknowns by roller travel.
    :ivar outputs: (4,) pose [m, m, rad] and squeeze [N] without a load, corrected by poses.
    :ivar predicted: (4,) predicted changes of the outputs by roller travel.
    :ivar anchors: (k,) rolling invariants of the contacts, corrected by poses [m].
    :ivar shift_changes: (3 + 4k,) changes of the unknowns by shifts since the equilibrium.
    :ivar zero_corrections: (r,) corrections of the roller offsets since the equilibrium [m].
    :ivar corrections_since_search: (r,) the same since the last search for contacts [m].
    :ivar usage: limits at the equilibrium on motion that reduces the slip margin or increases the
        utilisation.
    :ivar usage_error: error at the equilibrium while its utilisation is unknown, so that `usage`
        is predicted from the equilibrium before; None if it is known.
    :ivar begun: the grip after the first step to the equilibrium in the configuration that is
        expected when it is due; None before them.
    :ivar travel: (r,) roller travel since the equilibrium [m].
    :ivar step: (r,) roller travel in the last cycle [m].
    :ivar moved: (4,) change of the outputs by it.
    :ivar drift: present rate (4,) of the changes that (19) neglects [m/s, m/s, rad/s, N/s].
    """

    held: HeldGrip
    grip: Grip
    travel_rates: Array
    by_shifts: Array
    scale: Array
    rates: Array
    by_offsets: OffsetRates
    by_travel: TravelPrediction
    outputs: Array
    predicted: Array
    anchors: Array
    shift_changes: Array
    zero_corrections: Array
    corrections_since_search: Array
    usage: UsageLimits
    travel: Array
    step: Array
    moved: Array
    drift: Array
    usage_error: UsageError | None = None
    begun: HeldGrip | None = None

    @classmethod
    def of(cls, held: HeldGrip, friction: float) -> EquilibriumCache:
        """Return an equilibrium that a search has found."""
        by_offsets = OffsetRates.of(held)
        return cls(
            by_offsets=by_offsets,
            by_travel=TravelPrediction.of(by_offsets.by_travel),
            corrections_since_search=np.zeros(len(held.config.roller_positions)),
            usage=UsageLimits.of(held),
            drift=np.zeros(4),
            **_at_equilibrium(held, friction),
        )

    def taken(self, held: HeldGrip) -> EquilibriumCache:
        """Return another equilibrium and the derivatives at it, without changes since then."""
        start, has_all, by_travel = self.held, self.is_complete, self.by_travel
        positions, keeps_contacts = held.config.roller_positions, held.contacts is start.contacts
        travel = positions - start.config.roller_positions
        is_by_travel = held.pressures == start.pressures and not self.zero_corrections.any()
        if keeps_contacts and is_by_travel:
            change = held.state.unknowns - start.state.unknowns - self.shift_changes
            by_travel = by_travel.continued(travel, change)
        # Derivatives by offsets take longest; they and the utilisation follow in a later cycle.
        if not keeps_contacts:
            usage, error, drift = UsageLimits.of(held), None, np.zeros(4)
        else:
            usage, drift = self.usage.rolled(self.travel), self.drift
            error = UsageError(0.0, 0.0 * travel)
            if not self.zero_corrections.any():
                error = UsageError(held.slip_margin(self.grip.friction) - self.margin, self.travel)
        cache = replace(
            self,
            usage=usage,
            usage_error=error,
            drift=drift,
            by_travel=by_travel,
            **_at_equilibrium(held, self.grip.friction),
        )
        from_rates = np.abs(positions - self.by_offsets.held.config.roller_positions).max()
        is_near = has_all or from_rates <= MAX_FIRST_ORDER_TRAVEL
        if not (keeps_contacts and is_near):
            return cache.completed()
        return cache if has_all else cache.with_own_usage()

    @property
    def is_complete(self) -> bool:
        """Return whether utilisation and derivatives by offsets are those at this equilibrium."""
        return self.by_offsets.held is self.held and self.usage_error is None

    def completed(self) -> EquilibriumCache:
        """Return the equilibrium with its utilisation and the derivatives by offsets at it."""
        by_offsets, by_travel = OffsetRates.of(self.held), self.by_travel
        if self.held.contacts is self.by_offsets.held.contacts:
            by_travel = by_travel.with_rates(by_offsets.by_travel)
        else:
            by_travel = TravelPrediction.of(by_offsets.by_travel)
        return replace(self.with_own_usage(), by_offsets=by_offsets, by_travel=by_travel)

    def with_own_usage(self) -> EquilibriumCache:
        """Return the equilibrium with `usage` at it, learned from the error of its prediction."""
        if self.usage_error is None:
            return self
        usage = self.usage.learned(self.held, *self.usage_error)
        return replace(self, usage=usage, usage_error=None)

    def motion(self, travel: Array) -> Array:
        """Return the change (4,) of the outputs by travel (r,) since the equilibrium [m]."""
        return output_change(self.held, self.by_travel.change(travel))

    def predict(self, config: Configuration, elapsed: float) -> EquilibriumCache:
        """
        Predict the change of pose and squeeze by roller travel since the equilibrium.

        :param elapsed: time since the last prediction [s].
        """
        start = self.held.config.roller_positions + self.zero_corrections
        travel = config.roller_positions - start
        step, drift = travel - self.travel, self.drift
        predicted, moved = self.motion(travel), self.motion(step)
        if elapsed > 0.0:
            drift = (moved - self.travel_rates @ step) / elapsed
        changes = {'predicted': predicted, 'travel': travel, 'step': step, 'moved': moved}
        return replace(self, drift=drift, **changes)

    def travel_limit(self, pressures: Pressures, margin: float) -> float:
        """
        Return the norm of the travel beyond which the next equilibrium is due [m].

        Up to it the errors of the prediction are within `MAX_ERRORS`. Without a bound on them it
        is negative; near slip each motion needs an equilibrium.

        :param margin: slip margin [N], see `GripBelief.slip_margin`.
        """
        held = self.held
        if self.zero_corrections.any() or pressures not in (None, held.pressures):
            return -1.0
        (x, y, angle, squeeze), pose = self.outputs.tolist(), held.pose
        shift = math.hypot(x - pose.x, y - pose.y, held.arm * (angle - pose.angle))
        changes = shift, abs(squeeze - held.squeeze)
        rows = zip(MAX_ERRORS.tolist(), changes, CURVATURES.tolist(), strict=True)
        squares = [(limit - SHIFT_SHARE * change) / by_travel for limit, change, by_travel in rows]
        if min(squares) < 0.0:
            return -1.0
        if margin < NEAR_SLIP_SHARE * held.squeeze:
            return 0.0
        width = min((gap.width for gap in self.grip.gaps), default=math.inf)
        to_gap = max(float(MAX_ERRORS[0]), GAP_SHARE * width) / GAP_RATE
        return min(math.sqrt(min(squares)), to_gap)

    def prepared(self, config: Configuration, limit: float) -> EquilibriumCache:
        """Return the equilibrium after the work of a cycle in which the next one is not due."""
        travels = (math.hypot(*(self.travel + n * self.step)) for n in (1, 2))
        cycles = next((n for n, travel in enumerate(travels, 1) if travel > limit), None)
        if not self.is_complete:
            if cycles is not None or self.usage_error is None:
                return self.completed()
            self.held.sample_dents_ahead()
            return self.with_own_usage()
        if cycles is None or cycles * np.abs(self.step).max() > MAX_FIRST_ORDER_TRAVEL:
            return self
        expected = cycles * self.step
        if self._near_begun(config.roller_positions + expected, limit) is not None:
            return self
        start = self._start(self.held.pressures, self.travel + expected)
        try:
            begun = begin_roll(start, config.predict(expected))
        except WorkLimitError:  # the next cycle goes on
            return self
        return replace(self, begun=begun)

    def _near_begun(self, positions: Array, limit: float) -> HeldGrip | None:
        """Return `begun`; None if it is beyond a `limit` of travel from roller positions [m]."""
        if self.begun is None:
            return None
        if math.hypot(*(positions - self.begun.config.roller_positions)) > limit:
            return None
        return self.begun.with_anchors(self.anchors)

    def roll_begun(self, config: Configuration, limit: float) -> HeldGrip | None:
        """
        Return the equilibrium in the configuration of `begun`; None if none exists.

        It is also None if `begun` is farther from a configuration than a `limit` of travel [m].
        """
        grip = self._near_begun(config.roller_positions, limit)
        return grip and roll_grip(grip, grip.config, None, TRACKED, grip.alone.linear.tubes)

    def roll(
        self, config: Configuration, pressures: Pressures, shifts: Array | float = 0.0
    ) -> HeldGrip | None:
        """
        Return the equilibrium, rolled to a configuration; None if none exists.

        Before that, the k contacts are shifted along their members by all corrections since the
        equilibrium and by further `shifts` (k,) [m].
        """
        return roll_grip(self._start(pressures, self.travel, shifts), config, None, TRACKED)

    def _start(self, pressures: Pressures, travel: Array, shifts: Array | float = 0.0) -> HeldGrip:
        """Return the last equilibrium with all shifts, and with the motion predicted by travel."""
        inflated = with_tubes(self.held, pressures)
        motion = travel, self.by_travel.change(travel) + self.shift_changes
        return inflated.with_anchors(self.anchors + shifts, motion)

    def shifted(self, shifts: Array) -> EquilibriumCache:
        """Return the equilibrium with contacts shifted along members (m,) [m], to first order."""
        begun, changes = self.begun, self.by_shifts @ shifts
        if begun is not None:
            begun = begun.displaced(changes)
        return replace(
            self,
            begun=begun,
            anchors=self.anchors + shifts[self.held.contacts.owners],
            outputs=self.outputs + self.rates[:, SHIFTS:] @ shifts / self.scale,
            shift_changes=self.shift_changes + changes,
        )

    def corrected(self, correction: Array, sensitivity: Array) -> EquilibriumCache:
        """Return the equilibrium after a correction (r,) of offsets, which shifts contacts [m]."""
        shifts = (sensitivity[SHIFTS:] @ correction)[self.held.contacts.owners]
        by_statics = self.held.anchor_rates @ correction
        squeeze_rates = self.by_offsets.outputs[3] + self.rates[3] @ sensitivity
        return replace(
            self,
            anchors=self.anchors + by_statics + shifts,
            zero_corrections=self.zero_corrections + correction,
            corrections_since_search=self.corrections_since_search + correction,
            predicted=self.predicted + np.append(np.zeros(3), squeeze_rates @ correction),
        )

    @cached_property
    def margin(self) -> float:
        """Return the slip margin, with shifts and predicted travel since the equilibrium [N]."""
        planes = slip_planes(self.held.response, self.grip.friction)
        forces = self.shift_changes[self.held.state.places.forces]
        reserves = planes.reserve + planes.rows @ forces
        return float((reserves / planes.size).min()) - float(self.usage.rates[1] @ self.travel)


def _at_equilibrium(held: HeldGrip, friction: float) -> dict[str, Any]:
    """Return the fields that an equilibrium determines, without changes since then."""
    # The fourth row is the opening rate of the grip, on which the squeeze depends.
    grip, by_shifts = measure_gaps(held, friction), shift_rates(held)
    travel_rates = grip_jacobian(held.config, grip)[:4].copy()
    travel_rates[3] *= held.squeeze_stiffness()
    return {
        'held': held,
        'grip': grip,
        'travel_rates': travel_rates,
        'by_shifts': by_shifts,
        'scale': output_scale(held),
        'rates': state_rates(held, by_shifts),
        'outputs': np.append(held.pose, held.squeeze),
        'predicted': np.zeros(4),
        'anchors': held.anchors,
        'shift_changes': np.zeros(held.state.places.size),
        'zero_corrections': np.zeros(len(held.config.roller_positions)),
        'travel': np.zeros(len(held.config.roller_positions)),
        'step': np.zeros(len(held.config.roller_positions)),
        'moved': np.zeros(4),
        'begun': None,
    }
