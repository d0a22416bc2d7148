# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Squeeze control of a held object: the tracked grip, its faults, and the desired pose.

`SqueezeControl` is what the servo remembers of the grip. The commands follow from it by
`squeeze_law`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial

from isotruss_ros.core.errors import IsotrussError
from isotruss_ros.core.estimation.fault_thresholds import DEFAULT_FREQUENCY
from isotruss_ros.core.estimation.grip_belief import GripBelief, Readings
from isotruss_ros.core.estimation.grip_tracker import GripTracker
from isotruss_ros.core.estimation.state_estimate import is_squeeze_known
from isotruss_ros.core.holding.held_grip import HoldStatus
from isotruss_ros.core.inputs import StampedInput
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.status import RollerCommand, Status
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.frozen import replace
from isotruss_ros.core.servo.decision import describe_squeeze
from isotruss_ros.core.servo.grip_faults import GripFaults
from isotruss_ros.core.servo.servo_settings import SqueezeSettings
from isotruss_ros.core.servo.squeeze_law import (
    CHANGED,
    find_correction,
    find_opening_rate,
    pass_filters,
    Solve,
    solve_with_margins,
)
from isotruss_ros.core.servo.swing_watch import GAIN_SHARE, SwingWatch
import numpy as np


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
