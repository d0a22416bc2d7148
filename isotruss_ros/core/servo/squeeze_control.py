# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How hard the robot squeezes: the loop around the model of the held object.

The squeeze and the opening of the grip are one thing: each millimetre less presses by some
newtons more. The fourth row of (19), which keeps the grip, gets a right-hand side, and what the
elastic tubes do to the object's pose is corrected. The gains follow from the lowest natural
frequency of the held object, see `loop_gains`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import math

from isotruss_ros.core.estimation.contact_walk import JUMP_LENGTH, MAX_DEVIATIONS
from isotruss_ros.core.estimation.grip_belief import attach_model, GripBelief
from isotruss_ros.core.estimation.state_estimate import EstimatorSettings
from isotruss_ros.core.holding.held_grip import (
    HeldGrip,
    HoldStatus,
    MIN_MARGIN_SHARE,
    NotHeldError,
)
from isotruss_ros.core.holding.loaded_frame import lowest_frequency
from isotruss_ros.core.inputs import steady_pressures
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.status import RollerCommand, Status
from isotruss_ros.core.model.pose import Pose, pose_difference
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.servo.decision import describe_squeeze
from isotruss_ros.core.servo.grip_faults import GripFault, SwingWatch
from isotruss_ros.core.servo.loop_gains import choose_gain, gains_of, LoopGains, SLOW
from isotruss_ros.core.servo.squeeze_target import SqueezeSettings
import numpy as np

#: After an oscillation the rollers stand still for as long as this [s], and the gain is halved.
REST_TIME = 1.0
#: The squeeze changes no quicker than this [N/s].
MAX_FORCE_RATE = 10.0
#: Stamps of poses that differ by no more are the same [s].
SAME_STAMP = 1e-3
KNOWN = EstimatorSettings()

#: Solves the program for a twist (3,) and a rate of the grip's opening [m/s].
Solve = Callable[[Array, float], RollerCommand]


class SqueezeControl:
    """
    Regulates squeeze and pose of an object that the robot holds.

    :ivar belief: how it is held where the robot is; None before `follow`.
    :ivar reference: (x, y, angle) where the object is to be [m, rad]: where it was at first, moved
        by the twists carried out since; None before the first one.
    :ivar frequency: lowest natural frequency of the held object; None if not known [rad/s].
    :ivar gains: what follows from it; those of an unknown frequency before `follow`.
    :ivar fault: what is wrong with the grip; stays until `acknowledge`, but for oscillations.
    :param settings: what the squeeze is to be.
    """

    def __init__(self, settings: SqueezeSettings) -> None:
        self.settings = settings
        self._pressures: tuple[float, ...] | None = None
        self._offsets: Array | float | None = None
        self._zeros: Array | None = None
        self.acknowledge()

    def acknowledge(self) -> None:
        """Clear the fault and forget how and where the object is held: a client has acted."""
        self.fault: GripFault | None = None
        self._softening, self._why = 1.0, ''
        self.reset()

    def reset(self) -> None:
        """Forget how and where the object is held: both follow from the next measured pose."""
        self.belief: GripBelief | None = None
        self.reference: Array | None = None
        self.frequency: float | None = None
        self.gains: LoopGains = gains_of(SLOW)
        self._swings, self._rest = SwingWatch(), 0.0
        self._velocity, self._elapsed, self._slipped = np.zeros(3), 0.0, 0.0
        self._stamp = -math.inf

    def rest(self) -> None:
        """Let the object be wanted where it is once it is moved again."""
        self.reference, self._velocity = None, np.zeros(3)

    @property
    def grasp(self) -> HeldGrip | None:
        """Return how the object is held where the robot is; None before `follow`."""
        return None if self.belief is None else self.belief.grasp

    def lose(self) -> None:
        """Take note that the object is not between the members any more."""
        if self.belief is not None and self.fault is None:
            self._fail(GripFault.NOT_HELD, 'the object is not between the members')
        self.reset()

    def take_pressures(self, pressures: tuple[float, ...] | None) -> None:
        """
        Model the tubes with measured pressures, from the next cycle on.

        :param pressures: (t,) gauge, by tube in the order of the robot file [Pa]; None for those
            of the file. See `steady_pressures`: noise would move the rollers.
        """
        self._pressures = steady_pressures(self._pressures, pressures)

    def take_offsets(self, offsets: Array | float, covariance: Array | None) -> None:
        """
        Take corrected zeros of the rollers over.

        :param offsets: (r,) in the positions of the rollers from now on [m].
        :param covariance: (r, r) of these [m^2]; None where it is not known.
        """
        before, self._offsets, belief = self._offsets, offsets, self.belief
        fresh, self._zeros = covariance is not self._zeros, covariance
        if belief is None:
            return
        if fresh and covariance is not None:
            belief.take_zeros(covariance)
        if before is not None and not np.array_equal(offsets, before):
            belief.move_zeros(offsets - before)

    def note(self) -> str:
        """Return what is wrong with how the object is held; empty where nothing is."""
        if self.fault is GripFault.OSCILLATES:
            return f'the object oscillates: the gain is softened to {self.gains.pose:.3g} 1/s'
        if self.fault is not None:
            return f'{self._why}: open the grip, or set squeeze_force again to go on'
        notes = [f'slipped by {1e3 * self._slipped:.0f} mm, held'] if self._slipped else []
        if self.belief is not None and self.belief.squeeze_is_unknown:
            notes.append(f'held, {describe_squeeze(*self.squeeze)}')
        return '; '.join(notes)

    @property
    def squeeze(self) -> tuple[float, float] | None:
        """Return the mean normal force and its standard deviation [N]; None without a belief."""
        belief = self.belief
        return None if belief is None else (belief.squeeze, belief.squeeze_deviation)

    def follow(
        self,
        config: Configuration,
        grip: Grip,
        elapsed: float,
        sample: tuple[Pose, float] | None = None,
    ) -> HoldStatus:
        """
        Take belief and reference to now, and correct it by where the object was measured.

        It starts again from the measured pose where the model has lost the object.

        :param config: where the robot is.
        :param grip: how it holds the object, which is where the last pose has it now.
        :param elapsed: since the cycle before, for which its command held [s].
        :param sample: the last pose, and how much older than the configuration it is [s]; that of
            the grip, of now, if None.
        :return: whether the object is held in the model; if not, why.
        :raises GraspError: see `find_contacts`.
        :raises ConfigurationError: the configuration is singular.
        :raises StructureError: see `structure_of`.
        """
        self._elapsed, belief = elapsed, self.belief
        if self.reference is not None:
            self.reference = self.reference + elapsed * self._velocity
        if belief is None:
            return self._start(config, grip)
        hold = belief.follow(config, elapsed, self._pressures)
        if hold is not HoldStatus.HELD and not belief.attach(config, self._pressures):
            again = self._start(config, grip)
            if self.fault is None and again is not HoldStatus.HELD:
                self._fail(GripFault.NOT_HELD, f'not held: {hold.value}')
            return again
        self._choose_gains(belief.grasp)
        belief.pass_corrections(elapsed, self.gains.filter_time)
        pose, age = sample or (grip.body.pose, 0.0)
        self._observe(belief, pose, age, elapsed)
        self._look_for_swings(belief, elapsed)
        return HoldStatus.HELD

    def solve(self, twist: Array, period: float, solve: Solve) -> RollerCommand:
        """
        Return the command that moves the object as asked and brings the squeeze to its target.

        In a fault the object is not moved, and the squeeze is regulated on; or the rollers stand.

        :param twist: (3,) vx, vy [m/s], omega [rad/s] of the object in the robot frame.
        :param period: for which the command holds, positive [s].
        :param solve: the twist program.
        """
        if self.belief is None:
            raise ValueError('follow comes before solve')
        belief = self.belief
        if self.fault is GripFault.OSCILLATES:
            still = np.zeros(len(belief.grasp.config.roller_positions))
            return RollerCommand(still, np.zeros(3), 0.0, self.fault.halt)
        missing = self.gains.squeeze * (self.settings.force - belief.regulated_squeeze)
        rate = max(-MAX_FORCE_RATE, min(missing, MAX_FORCE_RATE))
        opening = (rate - belief.drift[3]) / belief.slope
        if self.fault is not None:
            held = solve(np.zeros(3), opening)
            return replace(held, scale=0.0, status=self.fault.halt)
        twist, correction = np.asarray(twist), self._correction(belief, period)
        command = _solve_within_limits(twist + correction, opening, solve)
        free = belief.slip_margin - MIN_MARGIN_SHARE * belief.regulated_squeeze
        share = belief.usage.margin_share(command, period, free) if twist.any() else 1.0
        if share < 1.0:
            slowed = _solve_within_limits(share * twist + correction, opening, solve)
            command = replace(
                slowed,
                scale=share * slowed.scale,
                status=Status.SLOWED_SLIP_MARGIN,
                limiting=(*slowed.limiting, 'the slip margin'),
            )
        return belief.usage.limit_utilisation(command, period, self.settings.max_utilisation)

    def advance(self, twist: Array, command: RollerCommand, missing: Array | float = 0.0) -> None:
        """
        Take note of what is carried out of a twist, which moves the reference from now on.

        :param twist: (3,) commanded [m/s, rad/s].
        :param command: that was solved for; in a direction other than the twist's it ends the
            reference.
        :param missing: (3,) part of its twist that acceleration or shape did not admit.
        """
        if command.status in (Status.UNREACHABLE, Status.SLIDING):
            self.reference = None
        self._velocity = command.scale * np.asarray(twist) - missing

    def _correction(self, belief: GripBelief, period: float) -> Array:
        """Return the twist (3,) that takes pose errors and what the rows of (19) miss away."""
        here = belief.regulated_pose
        if self.reference is None:
            self.reference = here
        # A command that holds for longer than the period must not correct too much.
        gain = min(self.gains.pose, 0.5 / max(period, self._elapsed))
        return gain * pose_difference(self.reference, here) - belief.drift[:3]

    def _start(self, config: Configuration, grip: Grip) -> HoldStatus:
        """Begin with the equilibrium near the measured pose."""
        self.belief = None
        try:
            found = attach_model(config, grip, self._pressures)
        except NotHeldError as error:
            return error.hold
        self._choose_gains(found)
        settings = replace(KNOWN, load=self.settings.load or KNOWN.load, zeros=self.settings.zeros)
        belief = GripBelief(found, grip, settings, self._zeros)
        # As far as the squeeze is not known, neither is the share of it that friction has to be.
        unsure = MAX_DEVIATIONS * belief.squeeze_deviation / belief.squeeze
        hold = found.hold(grip.friction * (1.0 + unsure))
        if hold is HoldStatus.HELD:
            self.belief, self._swings = belief, SwingWatch(self.frequency)
        return hold

    def _observe(self, belief: GripBelief, pose: Pose, age: float, elapsed: float) -> None:
        """Correct the belief by a pose that is new, and look for slips."""
        self._stamp -= elapsed  # of the last pose, against now
        if -age <= self._stamp + SAME_STAMP:
            return
        self._stamp = -age
        belief.observe(pose, age)
        walked = f'the object moved by {1e3 * belief.walk.length:.0f} mm against the members'
        if belief.jump:
            self._slipped = belief.walk.length
        elif belief.walk.length < 0.5 * self._slipped:
            self._slipped = 0.0
        if self.fault is not None:
            return
        if belief.jump > JUMP_LENGTH:
            self._fail(GripFault.NOT_HELD, walked)
        elif belief.walk.slipped:
            self._fail(GripFault.SLIPPED, walked)

    def _fail(self, fault: GripFault, why: str) -> None:
        """Latch a fault."""
        self.fault, self._why = fault, why

    def _choose_gains(self, grasp: HeldGrip) -> None:
        """Let the gains follow from the frequency."""
        settings = self.settings
        self.frequency = settings.frequency or lowest_frequency(grasp)
        gain = settings.pose_gain or choose_gain(self.frequency)
        self.gains = gains_of(self._softening * gain)

    def _look_for_swings(self, belief: GripBelief, elapsed: float) -> None:
        """After an oscillation stand still for a while, and go on more softly."""
        error, even = np.zeros(3), np.array([1.0, 1.0, belief.grasp.arm])
        if self.reference is not None:
            error = even * pose_difference(self.reference, belief.pose)
        self._rest = max(self._rest - elapsed, 0.0)
        if self.fault is GripFault.OSCILLATES and self._rest == 0.0:
            self.fault = None
            self._swings.forget()
        if self.fault is None and self._swings.update(error, belief.noise.deviation, elapsed):
            self.fault = GripFault.OSCILLATES
            self._rest, self._softening = REST_TIME, 0.5 * self._softening


def _solve_within_limits(wanted: Array, opening: float, solve: Solve) -> RollerCommand:
    """Return the command for a twist and a rate of opening; limits slow the twist first."""
    command = solve(wanted, opening)
    if not Status.SLOWED_ROLLER_SPEED <= command.status <= Status.SLOWED_BARRIER:
        return command
    for scale in (command.scale, 0.0):
        found = solve(scale * wanted, opening)
        if found.scale >= 1.0:
            break
    return replace(found, scale=scale, status=command.status, limiting=command.limiting)
