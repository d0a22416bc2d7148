# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Squeeze control: feedback from the estimated equilibrium of the held object.

The opening of the grip determines the squeeze: it changes by some newtons per millimetre. The
opening rate is the right-hand side of the fourth row of (19). An additional twist corrects the
displacement of the object on the elastic tubes. The gains follow from the lowest natural frequency
of the held object, see `swing_watch`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import math

from isotruss_ros.core.estimation.contact_walk import JUMP_LENGTH
from isotruss_ros.core.estimation.grip_belief import GripBelief, Readings
from isotruss_ros.core.estimation.state_estimate import is_squeeze_known
from isotruss_ros.core.holding.held_grip import HoldStatus, MIN_RELATIVE_MARGIN, NotHeldError
from isotruss_ros.core.holding.held_shape import lowest_frequency
from isotruss_ros.core.inputs import StampedInput, steady_pressures, UsedReadings
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.status import RollerCommand, Status
from isotruss_ros.core.model.pose import pose_difference
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.tolerances import ROUNDING
from isotruss_ros.core.servo.belief_start import BeliefStart
from isotruss_ros.core.servo.decision import describe_squeeze
from isotruss_ros.core.servo.servo_settings import SqueezeSettings
from isotruss_ros.core.servo.swing_watch import (
    DEFAULT_FREQUENCY,
    GAIN_SHARE,
    MAX_SQUEEZE_GAIN,
    SwingWatch,
)
import numpy as np

#: Largest rate of change of the squeeze [N/s].
MAX_FORCE_RATE = 10.0
#: Time at rest after an oscillation [s]; each oscillation also halves the gain.
REST_TIME = 1.0
#: Largest number of solutions for the scale of a twist at a limit [-], and smallest share of the
#: opening rate there [-]; at a limit of a single roller, the second solution is exact.
MAX_SCALE_STEPS, MIN_OPENING_SHARE = 4, 0.99
#: What a client does after a fault that persists.
NEXT_STEPS = {
    Status.HALT_SLIPPED: 'resume the grip (service resume_grip)',
    Status.HALT_NOT_HELD: 'pick up the object (action pick_object)',
}
#: Statuses of motions in another direction than that of the twist.
CHANGED = (Status.UNREACHABLE, Status.SLIDING)
#: Function that solves the quadratic program for a twist (3,) and an opening rate of the grip
#: [m/s].
Solve = Callable[[Array, float], RollerCommand]


class SqueezeControl:
    """
    Control of squeeze and pose of a held object, and detection of faults of its grip.

    :ivar belief: estimated state of the grip; None before the first `follow`.
    :ivar reference: desired pose (x, y, angle) of the object [m, rad]. It is the pose at the
        start of a motion plus the integral of the executed twists, and follows the object along
        unreachable directions; None before the first twist.
    :ivar frequency: lowest natural frequency of the held object [rad/s]; None if unknown.
    :ivar gain: pose gain for this frequency [1/s]; before the first `follow`, that for an unknown
        frequency.
    :ivar fault: status of the halt for a fault of the grip; None without a fault. It remains until
        a client acknowledges it; only the fault of an oscillation ends by itself.
    :ivar swings: detector of oscillations, replaced with each new belief.
    :ivar softening: factor on the gain after oscillations [-].
    :ivar slipped: length of a slip after which the object is still held, otherwise 0 [m].
    """

    def __init__(self, settings: SqueezeSettings) -> None:
        self.settings = settings
        self.frequency: float | None = None
        self.gain = GAIN_SHARE * DEFAULT_FREQUENCY
        self._rest = 0.0  # remaining time at rest after an oscillation [s]
        self._pressures: tuple[float, ...] | None = None
        self._offsets: Array | float | None = None
        self._zero_covariance: Array | None = None  # (r, r), see `take_offsets` [m^2]
        self._readings = UsedReadings()
        self.acknowledge()

    def acknowledge(self) -> None:
        """Clear the fault and the estimated grip after a client has reacted to the fault."""
        self.fault: Status | None = None
        self.softening, self._why = 1.0, ''
        self.reset()

    def reset(self) -> None:
        """Discard the estimated grip and the desired pose; a new measured pose restarts them."""
        self.belief: GripBelief | None = None
        self._lost: HoldStatus | None = None  # why the previous belief ended
        self._since = 0.0  # time since the last pose [s]
        self.slipped = 0.0
        self._start = BeliefStart()
        self._last_correction = np.zeros(3)  # twist of `_correction` in the last command
        self.rest()

    def rest(self) -> None:
        """Discard the desired pose; it restarts from the object's pose at the next motion."""
        self.reference, self._velocity = None, np.zeros(3)

    def lose(self) -> None:
        """Discard the grip of a lost object; set a fault if the object was held before."""
        if self.belief is not None or self._lost is not None:
            self.fail(Status.HALT_NOT_HELD, 'the object is not between the members')
        self.reset()

    def take_pressures(self, pressures: tuple[float, ...] | None) -> None:
        """Use measured gauge pressures [Pa] in the model, see `steady_pressures`."""
        self._pressures = steady_pressures(self._pressures, pressures)

    def take_offsets(self, offsets: Array | float, covariance: Array | None, stamp: float) -> None:
        """Set the offsets (r,) of the rollers [m] and their covariance, with a `stamp` [s]."""
        before, self._offsets, belief = self._offsets, offsets, self.belief
        self._zero_covariance = covariance
        if belief is None:
            return
        if covariance is not None:
            self._readings, is_new = self._readings.use('estimate', stamp, covariance)
            if is_new:
                belief = belief.with_offset_covariance(covariance)
        if before is not None and not np.array_equal(offsets, before):
            belief = belief.with_zeros_corrected(offsets - before)
        self.belief = belief

    def follow(
        self,
        config: Configuration,
        grip: Grip,
        elapsed: float,
        sample: tuple[StampedInput, float] | None = None,
        gripped: bool = False,
        rollers: Readings = None,
    ) -> HoldStatus:
        """
        Update the estimated grip and the desired pose; return the hold status by the model.

        The estimated equilibrium rolls with the robot. If it ceases to exist, a later call
        searches for a new one near the measured pose; each call searches at most once.

        :param sample: last measured pose, which is used once, and its age relative to the
            configuration [s]; None: a new pose, that of the grip.
        :param rollers: measured rollers, see `GripBelief.follow`.
        """
        self._elapsed, belief = elapsed, self.belief
        if self.reference is not None:
            self.reference = self.reference + elapsed * self._velocity
        if belief is None:
            return self._begin(config, grip, gripped)
        belief, hold = belief.followed(config, elapsed, self._pressures, rollers)
        if hold is not HoldStatus.HELD:
            self.belief, self._lost = None, hold
            return hold
        self._choose_gain(belief)
        lag = belief.lag.advanced(elapsed, 1.0 / self.gain)
        self.belief = belief = replace(belief, lag=lag)
        self._since += elapsed
        self._pause(elapsed)
        # Without a sample, the pose of the grip is new.
        measured, age = sample or (StampedInput(grip.body.pose, math.nan), 0.0)
        is_new = True
        if sample is not None:
            self._readings, is_new = self._readings.use('pose', measured.time, measured.value)
        if is_new:
            self.belief = belief = belief.observed(measured.value, age)
            self.judge(belief, self._since, self._velocity)
            self._since = 0.0
        return HoldStatus.HELD

    def solve(self, twist: Array, period: float, solve: Solve) -> RollerCommand:
        """
        Return the command that executes a twist (3,) of the object and controls the squeeze.

        During a fault only the squeeze is controlled; during an oscillation the rollers are
        stopped. The command is valid for a period [s].
        """
        belief: GripBelief = self.belief  # type: ignore[assignment]
        if self.fault is Status.HALT_OSCILLATES:
            stopped = np.zeros(len(belief.grasp.config.roller_positions))
            return RollerCommand(stopped, np.zeros(3), 0.0, self.fault)
        opening_rate = self._opening_rate(belief)
        if self.fault is not None:
            return replace(solve(np.zeros(3), opening_rate), scale=0.0, status=self.fault)

        twist = np.asarray(twist)
        correction = self._last_correction = self._correction(belief, period)
        command = _solve_within_limits(twist + correction, opening_rate, solve)
        if command.status in CHANGED and not twist.any():
            # Contacts or limits do not admit the correction of the pose.
            command = replace(command, status=Status.OK)
        # Limits on the loss of slip margin and on the utilisation.
        excess_margin = belief.slip_margin - MIN_RELATIVE_MARGIN * float(belief.regulated[3])
        share = belief.cache.usage.margin_share(command, period, excess_margin)
        if share < 1.0 and twist.any():
            slowed = _solve_within_limits(share * twist + correction, opening_rate, solve)
            scale, status = share * slowed.scale, Status.SLOWED_SLIP_MARGIN
            limiting = (*slowed.limiting, 'the slip margin')
            command = replace(slowed, scale=scale, status=status, limiting=limiting)
        return belief.cache.usage.limit_utilisation(command, period, self.settings.max_utilisation)

    def advance(self, twist: Array, command: RollerCommand, missing: Array | float = 0.0) -> None:
        """Let the desired pose move with the executed twist; limits have removed `missing`."""
        if command.status in CHANGED:
            # Where the twist is unreachable, its correction is as well: the desired pose follows.
            self._velocity = command.achieved_twist - self._last_correction - missing
        else:
            self._velocity = command.scale * np.asarray(twist) - missing

    def _opening_rate(self, belief: GripBelief) -> float:
        """Return the opening rate of the grip by proportional control of the squeeze [m/s]."""
        force = self.settings.force
        # While the squeeze would be unknown even with an exact stiffness, the excess of the first
        # estimate is added: opening the grip could release the object, and the measured pose would
        # not show the loss until the object is moved.
        if self._excess > 0.0 and not is_squeeze_known(force, belief.geometric_deviation):
            force += self._excess
        error = force - float(belief.regulated[3])
        force_rate = min(MAX_SQUEEZE_GAIN, self.gain) * error - belief.cache.drift[3]
        bounded_rate = max(-MAX_FORCE_RATE, min(force_rate, MAX_FORCE_RATE))
        return bounded_rate / belief.grasp.squeeze_stiffness()

    def _correction(self, belief: GripBelief, period: float) -> Array:
        """Return the twist (3,) that corrects the pose error and the motion that (19) neglects."""
        here = belief.regulated[:3]
        if self.reference is None:
            self.reference = here
        # A command that is valid for longer than the period must not overshoot.
        gain = min(self.gain, 0.5 / max(period, self._elapsed))
        return gain * pose_difference(self.reference, here) - belief.cache.drift[:3]

    def _begin(self, config: Configuration, grip: Grip, gripped: bool) -> HoldStatus:
        """Start the belief of the grip; return the hold status of the object."""
        gripped = gripped and self.fault is None
        try:
            belief = self._start.search(
                config, grip, self.settings, gripped, self._pressures, self._zero_covariance
            )
        except NotHeldError as error:
            # A belief was lost, and no other one starts: a fault, because the object was held.
            if error.hold is HoldStatus.SEARCHED:
                return error.hold
            if self._lost is not None:
                self.fail(Status.HALT_NOT_HELD, f'not held: {self._lost.value}')
            self._lost = None
            return error.hold
        self.belief, self._lost = belief, None
        smallest_squeeze = (1.0 - 2.0 * belief.settings.squeeze_error) * belief.squeeze
        self._excess = max(smallest_squeeze - self.settings.force, 0.0)
        self._choose_gain(belief)
        self.swings = SwingWatch.of(self.frequency)
        return HoldStatus.HELD

    def _choose_gain(self, belief: GripBelief) -> None:
        """Set the pose gain from the settings, or else from the natural frequency."""
        settings = self.settings
        self.frequency = settings.frequency or lowest_frequency(belief.cache.by_offsets.grasp)
        default_gain = GAIN_SHARE * (self.frequency or DEFAULT_FREQUENCY)
        self.gain = self.softening * (settings.pose_gain or default_gain)

    def fail(self, fault: Status, why: str) -> None:
        """Set a fault of the grip and its cause, unless a fault that persists is set already."""
        if self.fault in (None, Status.HALT_OSCILLATES):
            self.fault, self._why = fault, why

    def note(self, squeeze: tuple[float, float] | None = None) -> str:
        """Return a sentence on a fault of the grip or on an unknown squeeze, empty if neither."""
        if self.fault is Status.HALT_OSCILLATES:
            return f'the object oscillates: the pose gain is reduced to {self.gain:.3g} 1/s'
        if self.fault is not None:
            return f'{self._why}; next step: {NEXT_STEPS[self.fault]}'
        notes = [f'slipped by {1e3 * self.slipped:.0f} mm, held'] if self.slipped else []
        if squeeze is not None and not is_squeeze_known(*squeeze):
            is_assumed = self.belief is not None and self.belief.is_assumed
            notes.append(f'held, {describe_squeeze(*squeeze, is_assumed)}')
        return '; '.join(notes)

    def _pause(self, elapsed: float) -> None:
        """End the fault of an oscillation after the time at rest; poses may be equal at rest."""
        if self.fault is Status.HALT_OSCILLATES:
            self._rest -= elapsed
            if self._rest <= 0.0:
                self.fault = None
                self.swings = self.swings.restarted()

    def judge(self, belief: GripBelief, elapsed: float, velocity: Array) -> None:
        """
        Detect oscillation, slip and loss from the belief after a new pose.

        An oscillation halves the gain, and is a fault until `REST_TIME` has passed.

        :param elapsed: time since the previous pose [s].
        :param velocity: (3,) executed part of the twist [m/s, rad/s].
        """
        state = belief.state
        noise = math.sqrt(state.noise.variances.max())
        travel = elapsed * float(np.linalg.norm(belief.scale * velocity))
        self.swings, oscillates = self.swings.updated(belief.correction, noise, elapsed, travel)
        if self.fault is None and oscillates:
            self.fault = Status.HALT_OSCILLATES
            self._rest, self.softening = REST_TIME, 0.5 * self.softening
        slip = state.walk.length
        if state.jump:
            self.slipped = slip
        elif slip < 0.5 * self.slipped:
            self.slipped = 0.0
        moved = f'the object moved by {1e3 * slip:.0f} mm against the members'
        cause = f'{moved}, or the tracker turned or jumped'
        if state.jump > JUMP_LENGTH:
            self.fail(Status.HALT_NOT_HELD, cause)
        elif belief.slipped:
            self.fail(Status.HALT_SLIPPED, cause)


def _solve_within_limits(twist: Array, opening_rate: float, solve: Solve) -> RollerCommand:
    """Return the command for a twist and an opening rate; limits reduce only the twist."""
    command = solve(twist, opening_rate)
    if not Status.SLOWED_ROLLER_SPEED <= command.status <= Status.SLOWED_BARRIER:
        return command
    # The limits have scaled both. The excess of the scaled twist over the limits is a convex
    # function of its scale, so the secant method approaches the largest scale from above.
    larger, scale, slowed = 1.0, command.scale, command
    for _ in range(MAX_SCALE_STEPS):
        slowed_before, slowed = slowed, solve(scale * twist, opening_rate)
        if slowed.scale >= MIN_OPENING_SHARE or scale == 0.0:
            break
        excess, excess_before = (1.0 / max(c.scale, ROUNDING) for c in (slowed, slowed_before))
        change = (excess - 1.0) * (larger - scale) / max(excess_before - excess, ROUNDING)
        larger, scale = scale, max(scale - change, 0.0)
    else:
        scale, slowed = 0.0, solve(np.zeros(3), opening_rate)
    return replace(slowed, scale=scale, status=command.status, limiting=command.limiting)
