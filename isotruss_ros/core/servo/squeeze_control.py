# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Squeeze control, its law and its faults."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
import itertools
import math

from isotruss_ros.core.errors import IsotrussError
from isotruss_ros.core.estimation.grip_belief import GripBelief, Readings
from isotruss_ros.core.estimation.grip_tracker import GripTracker
from isotruss_ros.core.estimation.state_estimate import (
    DEFAULT_FREQUENCY,
    is_squeeze_known,
    JUMP_LENGTH,
    MAX_DEVIATIONS,
    MAX_SWING_PHASE,
    MAX_SWING_TIME,
    MIN_RETURN_SHARE,
    MIN_SWING,
    MIN_SWING_POSES,
    MIN_SWING_RATIO,
    REST_TIME,
    SWING_COUNT,
    TRAVEL_SHARE,
)
from isotruss_ros.core.holding.held_grip import HoldStatus, MIN_RELATIVE_MARGIN
from isotruss_ros.core.inputs import StampedInput
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.status import GRIP_FAULTS, RollerCommand, Status
from isotruss_ros.core.model.pose import pose_difference
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.records import replace
from isotruss_ros.core.numerics.tolerances import ROUNDING
from isotruss_ros.core.servo.decision import describe_squeeze
from isotruss_ros.core.servo.servo_settings import SqueezeSettings
import numpy as np

# Gains of the squeeze control, and detection of oscillations of the held object.
#
# Commands are roller velocities, so the loop is an integrator in front of a lightly damped
# structure. The loop has the pose gain p. The estimated load, and the part of the measured pose
# that neither load nor contacts explain (unexplained pose), pass two low-pass filters with the
# time constant 1 / p. A mode with the frequency omega and the damping ratio zeta is stable if
#
#     s^3 / p^2 + 3 s^2 / p + 3 s + p omega^2 / (s^2 + 2 zeta omega s + omega^2) = 0
#
# has no root in the right half-plane. Without damping this holds for p < 0.54 omega; with damping
# it holds up to a larger p. The gain of the squeeze is p, up to `MAX_SQUEEZE_GAIN`.

#: Ratio of the pose gain to the natural frequency [-]. The loop is stable even if the frequency is
#: wrong by a factor of two.
GAIN_SHARE = 0.25
#: Largest gain of the squeeze [1/s].
MAX_SQUEEZE_GAIN = 5.0


@dataclass(frozen=True)
class Swings:
    """
    Detector of oscillation in one signal.

    :ivar longest: longest half period [s].
    :ivar extremum: last extremum so far; NaN before the first value.
    :ivar previous: extremum before.
    :ivar sign: 1 while the last extremum is a maximum, -1 while it is a minimum.
    :ivar age: time since the previous extremum was passed [s].
    :ivar travel: commanded travel since then [m].
    :ivar poses: number of values since then [-].
    :ivar amplitudes: differences of successive extrema, at most `SWING_COUNT`.
    """

    longest: float
    extremum: float = math.nan
    previous: float = math.nan
    sign: float = 1.0
    age: float = 0.0
    travel: float = 0.0
    poses: int = 0
    amplitudes: tuple[float, ...] = ()

    @property
    def persist(self) -> bool:
        """Return whether successive swings do not decay, and the object swings back."""
        if len(self.amplitudes) < SWING_COUNT or self.age > self.longest:
            return False
        ratios = [b >= MIN_SWING_RATIO * a for a, b in itertools.pairwise(self.amplitudes)]
        swing_back = abs(self.extremum - self.previous)
        return all(ratios) and swing_back >= MIN_RETURN_SHARE * self.amplitudes[-1]

    def updated(self, value: float, elapsed: float, smallest: float, travel: float) -> Swings:
        """Return the detector after a value; smaller swings than `smallest` do not count."""
        extremum = value if math.isnan(self.extremum) else self.extremum
        previous = value if math.isnan(self.extremum) else self.previous
        age, travel, poses = self.age + elapsed, self.travel + travel, self.poses + 1
        # The extremum follows the value until the value has returned by the smallest swing.
        distance = self.sign * (extremum - value)
        if distance <= 0.0:
            extremum = value
        smallest = max(smallest, TRAVEL_SHARE * travel)
        if distance <= smallest:
            signs = self.sign, age, travel, poses, self.amplitudes
            return Swings(self.longest, extremum, previous, *signs)
        # The extremum ends a half period. A small, long or unresolved one is no swing; counting
        # restarts behind it.
        amplitude, amplitudes = abs(extremum - previous), self.amplitudes
        is_swing = amplitude > smallest and age <= self.longest and poses >= MIN_SWING_POSES
        amplitudes = (*amplitudes, amplitude)[-SWING_COUNT:] if is_swing else ()
        return Swings(self.longest, value, extremum, -self.sign, amplitudes=amplitudes)


@dataclass(frozen=True, eq=False)
class SwingWatch:
    """
    Detector of oscillations of a held object whose amplitude grows or stays constant.

    :ivar filter_time: time constant of the low-pass filter [s].
    :ivar swings: detectors of the coordinates.
    :ivar pose: (3,) filtered pose, see `updated` [m].
    """

    filter_time: float
    swings: tuple[Swings, ...]
    pose: Array = field(default_factory=partial(np.zeros, 3))

    @classmethod
    def of(cls, frequency: float | None = None) -> SwingWatch:
        """Return the detector for the lowest natural frequency [rad/s]; None if unknown."""
        # Noise is faster than a growing oscillation, which is the lowest mode.
        filter_time = 1.0 / (frequency or DEFAULT_FREQUENCY)
        longest = min(MAX_SWING_PHASE * math.pi * filter_time, MAX_SWING_TIME)
        return cls(filter_time, (Swings(longest),) * 3)

    def restarted(self) -> SwingWatch:
        """Return the detector without past swings."""
        return replace(self, swings=tuple(Swings(swings.longest) for swings in self.swings))

    def updated(
        self, pose: Array, noise: float, elapsed: float, travel: float
    ) -> tuple[SwingWatch, bool]:
        """
        Return the detector after a pose, and whether there is an oscillation without decay.

        :param pose: (3,) estimated pose minus the pose by roller travel alone, rotations times the
            characteristic radius [m]. Missing control cycles do not change it.
        :param noise: standard deviation of the measured pose [m].
        :param travel: commanded travel since the previous pose [m].
        """
        # Low-pass filter, in which the new pose has this weight.
        weight = -math.expm1(-elapsed / self.filter_time)
        filtered = self.pose + weight * (pose - self.pose)
        smallest = max(MIN_SWING, MAX_DEVIATIONS * noise)
        pairs = zip(self.swings, filtered.tolist(), strict=True)
        swings = tuple(one.updated(value, elapsed, smallest, travel) for one, value in pairs)
        is_reported = any(one.persist for one in swings)
        return SwingWatch(self.filter_time, swings, filtered), is_reported


# Law of the squeeze control: commands from the estimated equilibrium of the held object.
#
# The opening of the grip determines the squeeze: it changes by some newtons per millimetre. The
# opening rate is the right-hand side of the fourth row of (19). An additional twist corrects the
# displacement of the object on the elastic tubes. The gains follow from the lowest natural
# frequency of the held object, see `swing_watch`. The `outputs` (4,) are pose [m, m, rad] and
# squeeze [N] behind the filters.

#: Largest rate of change of the squeeze [N/s].
MAX_FORCE_RATE = 10.0
#: Largest number of solutions for the scale of a twist at a limit [-], and smallest share of the
#: opening rate there [-]; at a limit of a single roller, the second solution is exact.
MAX_SCALE_STEPS, MIN_OPENING_SHARE = 4, 0.99
#: Statuses of motions in another direction than that of the twist.
CHANGED = (Status.UNREACHABLE, Status.SLIDING)
#: Function that solves the quadratic program for a twist (3,) and an opening rate of the grip
#: [m/s].
Solve = Callable[[Array, float], RollerCommand]


def pass_filters(first: Array, second: Array, phase: float) -> Array:
    """
    Return the corrections (2, 4) in two low-pass filters after a time, relative to their constant.

    Corrections by poses reach the control behind them, because the loop is stable only then.
    """
    remaining = math.exp(-phase)
    return remaining * np.array([first, second + (1.0 - remaining) * first])


def find_opening_rate(
    belief: GripBelief, outputs: Array, force: float, excess: float, gain: float
) -> float:
    """
    Return the opening rate of the grip by proportional control of the squeeze [m/s].

    While the squeeze would be unknown even with an exact stiffness, the `excess` of the first
    estimate over the desired `force` is added [N]: opening the grip could release the object, and
    the measured pose would not show the loss until the object is moved.
    """
    if excess > 0.0 and not is_squeeze_known(force, belief.geometric_deviation):
        force += excess
    error = force - float(outputs[3])
    force_rate = min(MAX_SQUEEZE_GAIN, gain) * error - belief.cache.drift[3]
    bounded_rate = max(-MAX_FORCE_RATE, min(force_rate, MAX_FORCE_RATE))
    return bounded_rate / belief.held.squeeze_stiffness()


def find_correction(
    belief: GripBelief, outputs: Array, reference: Array, gain: float, duration: float
) -> Array:
    """
    Return the twist (3,) that corrects the pose error and the motion that (19) neglects.

    A command that is valid for a long `duration` must not overshoot [s].
    """
    error = pose_difference(reference, outputs[:3])
    return min(gain, 0.5 / duration) * error - belief.cache.drift[:3]


def solve_with_margins(
    belief: GripBelief,
    outputs: Array,
    twist: Array,
    correction: Array,
    opening_rate: float,
    solve: Solve,
    period: float,
    max_utilisation: float,
) -> RollerCommand:
    """
    Return the command for a twist (3,) of the object with its correction.

    Limits on slip margin and utilisation reduce only the twist. The command is valid for a period
    [s].
    """
    command = solve_within_limits(twist + correction, opening_rate, solve)
    if command.status in CHANGED and not twist.any():
        # Contacts or limits do not admit the correction of the pose.
        command = replace(command, status=Status.OK, scale=1.0)
    usage = belief.cache.usage.rolled(belief.cache.travel)
    excess_margin = belief.slip_margin - MIN_RELATIVE_MARGIN * float(outputs[3])
    share = usage.margin_share(command, period, excess_margin)
    if share < 1.0 and twist.any():
        slowed = solve_within_limits(share * twist + correction, opening_rate, solve)
        scale, status = share * slowed.scale, Status.SLOWED_SLIP_MARGIN
        limiting = (*slowed.limiting, 'the slip margin')
        command = replace(slowed, scale=scale, status=status, limiting=limiting)
    return usage.limit_utilisation(command, period, max_utilisation)


def solve_within_limits(twist: Array, opening_rate: float, solve: Solve) -> RollerCommand:
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


# Faults of a grip: oscillation, slip and loss, which remain until a client acknowledges them.
#
# Their thresholds are in `fault_thresholds`. A belief that was lost, without another one, is a
# loss as well, see `SqueezeControl`.


@dataclass(frozen=True, eq=False)
class GripFaults:
    """
    Fault of a grip, and what its detection remembers.

    :ivar fault: status of the halt; None without a fault. It remains until a client acknowledges
        it; only the fault of an oscillation ends by itself.
    :ivar why: cause of a fault that persists.
    :ivar softening: factor on the gain after oscillations [-].
    :ivar rest: remaining time at rest after an oscillation [s].
    :ivar slipped: length of a slip after which the object is still held, otherwise 0 [m].
    :ivar swings: detector of oscillations, replaced with each new belief.
    """

    fault: Status | None = None
    why: str = ''
    softening: float = 1.0
    rest: float = 0.0
    slipped: float = 0.0
    swings: SwingWatch | None = None

    def failed(self, fault: Status, why: str) -> GripFaults:
        """Return the faults with another one and its cause, unless one that persists is set."""
        if self.fault not in (None, Status.HALT_OSCILLATES):
            return self
        return replace(self, fault=fault, why=why)

    def rested(self, elapsed: float) -> GripFaults:
        """Return the faults after a time [s]; a rest ends the fault of an oscillation."""
        if self.fault is not Status.HALT_OSCILLATES:
            return self
        rest = self.rest - elapsed
        if rest > 0.0:
            return replace(self, rest=rest)
        return replace(self, rest=rest, fault=None, swings=self.swings.restarted())

    def judged(self, belief: GripBelief, elapsed: float, velocity: Array) -> GripFaults:
        """
        Return the faults by the belief after a new pose.

        An oscillation halves the gain, and is a fault until `REST_TIME` has passed.

        :param elapsed: time since the previous pose [s].
        :param velocity: (3,) executed part of the twist [m/s, rad/s].
        """
        state = belief.state
        noise = math.sqrt(state.noise.variances.max())
        travel = elapsed * float(np.linalg.norm(belief.scale * velocity))
        swings, oscillates = self.swings.updated(belief.displacement, noise, elapsed, travel)
        slip, slipped = state.walk.length, self.slipped
        if state.jump:
            slipped = slip
        elif slip < 0.5 * slipped:
            slipped = 0.0
        faults = replace(self, swings=swings, slipped=slipped)
        if self.fault is None and oscillates:
            rest, softening = REST_TIME, 0.5 * self.softening
            fault = Status.HALT_OSCILLATES
            faults = replace(faults, fault=fault, rest=rest, softening=softening)
        moved = f'the object moved by {1e3 * slip:.0f} mm against the members'
        cause = f'{moved}, or the tracker turned or jumped'
        if state.jump > JUMP_LENGTH:
            return faults.failed(Status.HALT_NOT_HELD, cause)
        return faults.failed(Status.HALT_SLIPPED, cause) if belief.slipped else faults

    def describe(self, gain: float) -> str:
        """Return a sentence on the fault, for a pose gain [1/s]; empty without a fault."""
        if self.fault is Status.HALT_OSCILLATES:
            return f'the object oscillates: the pose gain is reduced to {gain:.3g} 1/s'
        if self.fault is not None:
            return f'{self.why}; next step: {GRIP_FAULTS[self.fault].remedy}'
        return ''


# Squeeze control of a held object: the tracked grip, its faults, and the desired pose.
#
# `SqueezeControl` is what the servo remembers of the grip. The commands follow from it by
# `squeeze_law`.


@dataclass(frozen=True, eq=False)
class SqueezeControl:
    """
    Tracked grip of a held object, with its faults and the desired pose.

    :ivar tracker: estimated state of the grip.
    :ivar faults: fault of the grip, and what its detection remembers.
    :ivar reference: desired pose (x, y, angle) of the object [m, rad]. It is the pose at the
        start of a motion plus the integral of the executed twists, and follows the object along
        unreachable directions; None before the first twist.
    :ivar velocity: (3,) executed part of the last twist [m/s, rad/s].
    :ivar frequency: lowest natural frequency of the held object [rad/s]; None if unknown.
    :ivar gain: pose gain for this frequency [1/s]; before the first `followed`, that for an
        unknown frequency.
    :ivar filters: (2, 4) corrections of pose [m, m, rad] and squeeze [N] that are still in the two
        low-pass filters in series, see `swing_watch`.
    :ivar excess: excess of the first estimate of the squeeze over the desired one [N].
    :ivar elapsed: time of the last cycle [s].
    :ivar since_pose: time since the last pose [s].
    """

    tracker: GripTracker = field(default_factory=GripTracker)
    faults: GripFaults = field(default_factory=GripFaults)
    reference: Array | None = None
    velocity: Array = field(default_factory=partial(np.zeros, 3))
    frequency: float | None = None
    gain: float = GAIN_SHARE * DEFAULT_FREQUENCY
    filters: Array = field(default_factory=partial(np.zeros, (2, 4)))
    excess: float = 0.0
    elapsed: float = 0.0
    since_pose: float = 0.0

    @property
    def fault(self) -> Status | None:
        """Return the status of the halt for a fault of the grip; None without a fault."""
        return self.faults.fault

    def acknowledged(self) -> SqueezeControl:
        """Return the control without fault and grip, after a client has reacted to the fault."""
        faults = replace(self.faults, fault=None, softening=1.0, why='')
        return replace(self, faults=faults).restarted()

    def restarted(self) -> SqueezeControl:
        """Return the control without grip and desired pose, which a new pose restarts."""
        tracker, faults = self.tracker.discarded(), replace(self.faults, slipped=0.0)
        return replace(self, tracker=tracker, faults=faults, since_pose=0.0).at_rest()

    def at_rest(self) -> SqueezeControl:
        """Return the control without desired pose, which the next motion restarts."""
        return replace(self, reference=None, velocity=np.zeros(3))

    def lost(self) -> SqueezeControl:
        """Return the control after a loss, which is a fault if the object was held before."""
        faults = self.faults
        if self.tracker.belief is not None or self.tracker.lost is not None:
            faults = faults.failed(Status.HALT_NOT_HELD, 'the object is not between the members')
        return replace(self, faults=faults).restarted()

    def followed(
        self,
        settings: SqueezeSettings,
        config: Configuration,
        grip: Grip,
        elapsed: float,
        sample: tuple[StampedInput, float],
        gripped: bool = False,
        rollers: Readings = None,
    ) -> tuple[SqueezeControl, HoldStatus | IsotrussError]:
        """
        Update the estimated grip and the desired pose; return also the hold status by the model.

        The estimated equilibrium rolls with the robot. If it ceases to exist, a later call
        searches for a new one near the measured pose; each call searches at most once.

        :param sample: last measured pose, which is used once, and its age relative to the
            configuration [s].
        :param rollers: measured rollers, see `GripBelief.followed`.
        :return: the control, and the hold status, or an error of the search.
        """
        reference = None if self.reference is None else self.reference + elapsed * self.velocity
        before = self.tracker.belief
        if before is None:
            control = replace(self, elapsed=elapsed, reference=reference)
            return control._begun(settings, config, grip, gripped)
        tracker, hold = self.tracker.followed(config, elapsed, rollers)
        belief = tracker.belief
        if belief is None:
            return replace(self, tracker=tracker, elapsed=elapsed, reference=reference), hold
        frequency, gain = self._tune(settings, belief)
        first = self.filters[0] + (belief.corrections - before.corrections)
        filters = pass_filters(first, self.filters[1], elapsed * gain)
        faults, since = self.faults.rested(elapsed), self.since_pose + elapsed
        tracker, is_new = tracker.observed(*sample)
        if is_new:
            faults, since = faults.judged(tracker.belief, since, self.velocity), 0.0
            filters[0] += tracker.belief.corrections - belief.corrections
        control = replace(
            self,
            tracker=tracker,
            faults=faults,
            reference=reference,
            frequency=frequency,
            gain=gain,
            filters=filters,
            elapsed=elapsed,
            since_pose=since,
        )
        return control, hold

    def command(
        self, settings: SqueezeSettings, twist: Array, period: float, solve: Solve
    ) -> tuple[SqueezeControl, RollerCommand, Array]:
        """
        Return the command that executes a twist (3,) of the object and controls the squeeze.

        During a fault only the squeeze is controlled; during an oscillation the rollers are
        stopped. The command is valid for a period [s].

        :return: the control with the desired pose, the command, and the correction (3,) of the
            pose in it [m/s, rad/s].
        """
        belief: GripBelief = self.tracker.belief  # type: ignore[assignment]
        fault, none = self.faults.fault, np.zeros(3)
        if fault is Status.HALT_OSCILLATES:
            stopped = np.zeros(len(belief.held.config.roller_positions))
            return self, RollerCommand(stopped, none, 0.0, fault), none
        outputs = belief.outputs - self.filters.sum(axis=0)
        opening_rate = find_opening_rate(belief, outputs, settings.force, self.excess, self.gain)
        if fault is not None:
            command = replace(solve(none, opening_rate), scale=0.0, status=fault)
            return self, command, none
        control = self if self.reference is not None else replace(self, reference=outputs[:3])
        duration = max(period, self.elapsed)
        correction = find_correction(belief, outputs, control.reference, self.gain, duration)
        command = solve_with_margins(
            belief,
            outputs,
            np.asarray(twist),
            correction,
            opening_rate,
            solve,
            period,
            settings.max_utilisation,
        )
        return control, command, correction

    def advanced(
        self,
        twist: Array,
        command: RollerCommand,
        correction: Array,
        missing: Array | float = 0.0,
    ) -> SqueezeControl:
        """
        Return the control with the desired pose in motion by the executed part of the twist.

        :param command: command that contains a correction (3,) of the pose.
        :param missing: twist that limits have removed from the command.
        """
        if command.status in CHANGED:
            # Where the twist is unreachable, its correction is as well: the desired pose follows.
            velocity = command.achieved_twist - correction - missing
        else:
            velocity = command.scale * np.asarray(twist) - missing
        return replace(self, velocity=velocity)

    def _begun(
        self, settings: SqueezeSettings, config: Configuration, grip: Grip, gripped: bool
    ) -> tuple[SqueezeControl, HoldStatus | IsotrussError]:
        """Return the control after a search for a first equilibrium, and the hold status."""
        faults, lost = self.faults, self.tracker.lost
        prior = settings.prior(config.robot.description)
        force = settings.force if gripped and self.fault is None else None
        tracker, hold = self.tracker.searched(config, grip, prior, force=force)
        if tracker.belief is None:
            # A belief was lost, and no other one starts: a fault, because the object was held.
            if lost is not None and tracker.lost is None:
                faults = faults.failed(Status.HALT_NOT_HELD, f'not held: {lost.value}')
            return replace(self, tracker=tracker, faults=faults), hold
        belief = tracker.belief
        smallest_squeeze = (1.0 - 2.0 * belief.settings.squeeze_error) * belief.squeeze
        excess = max(smallest_squeeze - settings.force, 0.0)
        frequency, gain = self._tune(settings, belief)
        faults = replace(faults, swings=SwingWatch.of(frequency))
        control = replace(
            self,
            tracker=tracker,
            faults=faults,
            frequency=frequency,
            gain=gain,
            filters=np.zeros((2, 4)),
            excess=excess,
        )
        return control, hold

    def _tune(self, settings: SqueezeSettings, belief: GripBelief) -> tuple[float | None, float]:
        """Return the natural frequency, and the gain of the settings or of this frequency."""
        frequency = settings.frequency or belief.cache.by_offsets.frequency
        default_gain = GAIN_SHARE * (frequency or DEFAULT_FREQUENCY)
        return frequency, self.faults.softening * (settings.pose_gain or default_gain)

    def note(self, squeeze: tuple[float, float] | None = None) -> str:
        """Return a sentence on a fault of the grip or on an unknown squeeze, empty if neither."""
        if self.fault is not None:
            return self.faults.describe(self.gain)
        slipped = self.faults.slipped
        notes = [f'slipped by {1e3 * slipped:.0f} mm, held'] if slipped else []
        if squeeze is not None and not is_squeeze_known(*squeeze):
            belief = self.tracker.belief
            is_assumed = belief is not None and belief.is_assumed
            notes.append(f'held, {describe_squeeze(*squeeze, is_assumed)}')
        return '; '.join(notes)
