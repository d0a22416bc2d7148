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

from isotruss_ros.core.control.grip_watch import GripFault, GripWatch
from isotruss_ros.core.control.held_model import attach_model, HeldModel, Observation
from isotruss_ros.core.control.inputs import steady_pressures
from isotruss_ros.core.control.loop_gains import choose_gain, gains_of, LoopGains, SLOW
from isotruss_ros.core.control.squeeze_target import SqueezeSettings, SqueezeTrim
from isotruss_ros.core.control.state_estimate import EstimatedTravel
from isotruss_ros.core.holding.held_grip import HeldGrip, HoldStatus, LEFT_MARGIN, NotHeldError
from isotruss_ros.core.holding.loaded_frame import lowest_frequency
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.status import RollerCommand, Status
from isotruss_ros.core.model.pose import pose_difference
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: After an oscillation the rollers stand still for as long as this [s], and the gain is halved.
REST_TIME = 1.0
#: The squeeze changes no quicker than this [N/s].
MAX_FORCE_RATE = 10.0
#: Zeros that are corrected by more than this begin the model anew [m].
RESTART = 2e-3
#: Faults in which the rollers stand still; in the others the squeeze is regulated on.
STILL = frozenset({GripFault.POSE_DISAGREES, GripFault.OSCILLATES})

#: Solves the program for a twist (3,) and a rate of the grip's opening [m/s].
Solve = Callable[[Array, float], RollerCommand]


class SqueezeControl:
    """
    Regulates squeeze and pose of an object that the robot holds.

    :ivar model: how it is held where the robot is, and the load on it; None before `follow`.
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
        self.acknowledge()

    def acknowledge(self) -> None:
        """Clear the fault and forget how and where the object is held: a client has acted."""
        self.fault: GripFault | None = None
        self._softening = 1.0
        self.reset()

    def reset(self) -> None:
        """Forget how and where the object is held: both follow from the next measured pose."""
        self.model: HeldModel | None = None
        self.reference: Array | None = None
        self.frequency: float | None = None
        self.gains: LoopGains = gains_of(SLOW)
        self._watch, self._rest = GripWatch(), 0.0
        self._velocity, self._asked, self._elapsed = np.zeros(3), np.zeros(3), 0.0
        self._measured = np.zeros(3)
        self._trim = SqueezeTrim()
        self._offsets: Array | float | None = None

    @property
    def grasp(self) -> HeldGrip | None:
        """Return how the object is held where the robot is; None before `follow`."""
        return None if self.model is None else self.model.grasp

    def lose(self) -> None:
        """Take note that the object is not between the members any more."""
        if self.model is not None and self.fault is None:
            self.fault = GripFault.NOT_HELD
        self.reset()

    def take_pressures(self, pressures: tuple[float, ...] | None) -> None:
        """
        Model the tubes with measured pressures, from the next cycle on.

        :param pressures: (t,) gauge, by tube in the order of the robot file [Pa]; None for those
            of the file. See `steady_pressures`: noise would move the rollers.
        """
        self._pressures = steady_pressures(self._pressures, pressures)

    def take_estimate(self, estimate: EstimatedTravel | None, offsets: Array | float) -> None:
        """
        Regulate an estimated squeeze, and take corrected zeros of the rollers over.

        :param estimate: fresh; None without one.
        :param offsets: (r,) in the positions of the rollers from now on [m].
        """
        self._trim.estimate = estimate
        before, self._offsets, model = self._offsets, offsets, self.model
        if model is None or before is None or np.array_equal(offsets, before):
            return
        moved = np.broadcast_to(offsets - before, model.grasp.config.roller_positions.shape)
        if np.abs(moved).max() > RESTART or not model.move_zeros(moved):
            self.reset()

    def note(self) -> str:
        """Return what is wrong with how the object is held; empty where nothing is."""
        if self.fault is GripFault.OSCILLATES:
            return f'the object oscillates: the gain is softened to {self.gains.pose:.3g} 1/s'
        if self.fault is not None:
            return f'{self.fault.value}: open the grip, or set squeeze_force again to go on'
        return self._trim.note()

    @property
    def squeeze(self) -> tuple[float, float] | None:
        """Return mean normal force and its standard deviation, inf if not known [N]; or None."""
        return None if self.model is None else self._trim.tell(self.model.squeeze)

    def follow(self, config: Configuration, grip: Grip, elapsed: float) -> HoldStatus:
        """
        Take model and reference to now, and the load from where the object was measured.

        The model starts again from the measured pose where it has lost the object.

        :param config: where the robot is.
        :param grip: how it holds the object, which is where it was measured.
        :param elapsed: since the cycle before, for which its command held [s].
        :return: whether the object is held in the model; if not, why.
        :raises GainError: see `choose_gain`.
        :raises GraspError: see `find_contacts`.
        :raises ConfigurationError: the configuration is singular.
        :raises StructureError: see `structure_of`.
        """
        self._elapsed = elapsed
        if self.reference is not None:
            self.reference = self.reference + elapsed * self._velocity
        if self.model is None:
            return self._start(config, grip)
        hold = self.model.follow(config, elapsed, self._pressures)
        if hold is HoldStatus.HELD:
            self._choose_gains(self.model.grasp)
            seen = self.model.observe(grip, elapsed, self.gains)
            self._trim.follow(self.model.squeeze, self.settings.force, elapsed)
            self._look_for_faults(seen, grip, elapsed)
            return hold
        again = self._start(config, grip)
        if self.fault is None and hold is HoldStatus.SLIPS:
            self.fault = GripFault.SLIPPED
        elif self.fault is None and again is not HoldStatus.HELD:
            self.fault = GripFault.NOT_HELD
        return again

    def solve(self, twist: Array, period: float, solve: Solve) -> RollerCommand:
        """
        Return the command that moves the object as asked and brings the squeeze to its target.

        In a fault the object is not moved, and the squeeze is regulated on; or the rollers stand.

        :param twist: (3,) vx, vy [m/s], omega [rad/s] of the object in the robot frame.
        :param period: for which the command holds, positive [s].
        :param solve: the twist program.
        """
        if self.model is None:
            raise ValueError('follow comes before solve')
        model = self.model
        if self.fault in STILL:
            still = np.zeros(len(model.grasp.config.roller_positions))
            return RollerCommand(still, np.zeros(3), 0.0, self.fault.halt)
        missing = self.gains.squeeze * (self.settings.force + self._trim.force - model.squeeze)
        rate = max(-MAX_FORCE_RATE, min(missing, MAX_FORCE_RATE))
        opening = (rate - model.drift[3]) / model.slope
        if self.fault is not None:
            held = solve(np.zeros(3), opening)
            return replace(held, scale=0.0, status=self.fault.halt)
        twist, correction = np.asarray(twist), self._correction(model, period)
        command = _solve_within_limits(twist + correction, opening, solve)
        free = model.sure_margin - LEFT_MARGIN * model.squeeze
        share = model.usage.margin_share(command, period, free) if twist.any() else 1.0
        if share < 1.0:
            slowed = _solve_within_limits(share * twist + correction, opening, solve)
            command = replace(
                slowed,
                scale=share * slowed.scale,
                status=Status.SLOWED_SLIP_MARGIN,
                limiting=(*slowed.limiting, 'the slip margin'),
            )
        return model.usage.limit_utilisation(command, period, self.settings.max_utilisation)

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
        self._asked = np.asarray(twist)
        self._velocity = command.scale * self._asked - missing

    def _correction(self, model: HeldModel, period: float) -> Array:
        """Return the twist (3,) that takes pose errors and what the rows of (19) miss away."""
        here = model.pose + model.load.bias
        if self.reference is None:
            self.reference = here
        # A command that holds for longer than the period must not correct too much.
        gain = min(self.gains.pose, 0.5 / max(period, self._elapsed))
        return gain * pose_difference(self.reference, here) - model.drift[:3]

    def _start(self, config: Configuration, grip: Grip) -> HoldStatus:
        """Begin with the equilibrium near the measured pose."""
        self.model = None
        try:
            found = attach_model(config, grip, self._pressures)
        except NotHeldError as error:
            return error.hold
        self._choose_gains(found)
        self.model = HeldModel(found, grip, self.settings.load)
        self._measured = np.array(grip.body.pose)
        self._watch = GripWatch(self.frequency)
        return found.hold(grip.friction)

    def _choose_gains(self, grasp: HeldGrip) -> None:
        """Let the gains follow from the frequency."""
        settings, description = self.settings, grasp.config.robot.description
        self.frequency = settings.frequency or lowest_frequency(grasp)
        gain = choose_gain(
            self.frequency, description.damping_ratio, settings.pose_gain, settings.force_gain
        )
        self.gains = gains_of(self._softening * gain)

    def _look_for_faults(self, seen: Observation, grip: Grip, elapsed: float) -> None:
        """Watch the grip; after an oscillation stand still for a while, and go on more softly."""
        measured, even = grip.body.pose, np.array([1.0, 1.0, grip.body.arm])
        asked, went = elapsed * self._asked, pose_difference(measured, self._measured)
        self._measured = np.array(measured)
        error = np.zeros(3)
        if self.reference is not None:
            error = pose_difference(self.reference, measured)
        self._rest = max(self._rest - elapsed, 0.0)
        if self.fault is GripFault.OSCILLATES and self._rest == 0.0:
            self.fault = None
            self._watch.forget_swings()
        if self.fault is not None:
            return
        self.fault = self._watch.update(seen, even * error, even * asked, even * went, elapsed)
        if self.fault is GripFault.OSCILLATES:
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
