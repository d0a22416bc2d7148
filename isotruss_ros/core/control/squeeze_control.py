# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
How hard the robot squeezes: the model of the held object in the loop of the twist program.

The squeeze and the opening of the grip are one thing: each millimetre less presses by some
newtons more. The fourth row of (19), which keeps the grip, gets a right-hand side, and what the
elastic tubes do to the object's pose is corrected. The model is evaluated in each cycle, in the
configuration of the robot and under the estimated load; what it did beyond the rows of (19) over
the last cycle is expected of the next one as well. The gains follow from the lowest natural
frequency of the held object, see `loop_gains`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
import math

from isotruss_ros.core.control.grip_watch import GripFault, GripWatch, PoseComparison
from isotruss_ros.core.control.held_model import attach_model, move_zeros, Sensitivity, sensitivity
from isotruss_ros.core.control.inputs import steady_pressures
from isotruss_ros.core.control.load_estimate import LoadEstimate, LoadSettings
from isotruss_ros.core.control.loop_gains import choose_gain, gains_of, LoopGains, SLOW
from isotruss_ros.core.control.state_estimate import EstimatedTravel
from isotruss_ros.core.control.usage_limits import UsageLimits
from isotruss_ros.core.holding.held_grip import HeldGrip, HoldStatus, LEFT_MARGIN
from isotruss_ros.core.holding.loaded_frame import lowest_frequency
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.manipulation.status import RollerCommand, Status
from isotruss_ros.core.model.pose import Pose, pose_difference
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: After an oscillation the rollers stand still for as long as this [s], and the gain is halved.
REST_TIME = 1.0
#: The target moves by the difference to an estimated squeeze, behind this low-pass [s], ...
TRIM_TIME = 0.5
#: ... where its deviation is no larger share of the target than this.
TRUSTED = 0.2
#: Fewer poses than this do not tell of their noise.
FEWEST = 4
#: Zeros that are corrected by more than this begin the model anew [m].
RESTART = 2e-3
#: The status in each fault.
HALTS = {
    GripFault.SLIPPED: Status.HALT_SLIPPED,
    GripFault.NOT_HELD: Status.HALT_NOT_HELD,
    GripFault.POSE_DISAGREES: Status.HALT_POSE_DISAGREES,
    GripFault.OSCILLATES: Status.HALT_OSCILLATES,
}
#: Faults in which the rollers stand still; in the others the squeeze is regulated on.
STILL = frozenset({GripFault.POSE_DISAGREES, GripFault.OSCILLATES})

#: Solves the program for a twist (3,) and a rate of the grip's opening [m/s].
Solve = Callable[[Array, float], RollerCommand]


@dataclass(frozen=True)
class SqueezeSettings:
    """
    What the squeeze is to be, and how quickly it gets there.

    :ivar force: mean normal force of the grasping members, positive [N].
    :ivar friction: coefficient between tube and object.
    :ivar pose_gain: the user's own gain of the pose, from which the others follow; None for that
        of the frequency, see `choose_gain` [1/s].
    :ivar force_gain: accept a gain beyond the limit.
    :ivar frequency: lowest natural frequency of the held object, measured; None to compute it from
        the masses [rad/s].
    :ivar max_force_rate: the squeeze changes no quicker than this [N/s].
    :ivar max_utilisation: of the moment at which tubes wrinkle; commands that lead toward it are
        slowed, and beyond it only those that lead away are carried out [-].
    :ivar utilisation_rate: share of what is left to that bound that is used in a second [1/s].
    :ivar load: what loads and errors are expected.
    """

    force: float
    friction: float
    pose_gain: float | None = None
    force_gain: bool = False
    frequency: float | None = None
    max_force_rate: float = 10.0
    max_utilisation: float = 1.0
    utilisation_rate: float = 5.0
    load: LoadSettings = field(default_factory=LoadSettings)


class SqueezeControl:
    """
    Regulates squeeze and pose of an object that the robot holds.

    :ivar grasp: the model of how it is held where the robot is; None before `follow`.
    :ivar load: the wrench on the object that follows from its measured pose.
    :ivar reference: (x, y, angle) where the object is to be [m, rad]: where it was at first, moved
        by the twists carried out since; None before the first one.
    :ivar slip_margin: of the object under the estimated load [N].
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
        self.grasp: HeldGrip | None = None
        self.load = LoadEstimate(self.settings.load)
        self.reference: Array | None = None
        self.slip_margin = 0.0
        self.frequency: float | None = None
        self.gains: LoopGains = gains_of(SLOW)
        self._watch, self._rest = GripWatch(), 0.0
        self._velocity, self._asked, self._elapsed = np.zeros(3), np.zeros(3), 0.0
        self._pose, self._squeeze, self._slope = np.zeros(3), 0.0, 0.0
        self._measured = np.zeros(3)
        self._rows, self._drift = np.zeros((4, 0)), np.zeros(4)
        self._estimate: EstimatedTravel | None = None
        self._offsets: Array | float | None = None
        self._trim = self._averaged = 0.0
        self._first: list[Array] = []

    def lose(self) -> None:
        """Take note that the object is not between the members any more."""
        if self.grasp is not None and self.fault is None:
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
        self._estimate = estimate
        before, self._offsets, grasp = self._offsets, offsets, self.grasp
        if grasp is None or before is None or np.array_equal(offsets, before):
            return
        moved = np.broadcast_to(offsets - before, grasp.config.roller_positions.shape)
        self.grasp = move_zeros(grasp, moved) if np.abs(moved).max() <= RESTART else None
        if self.grasp is None:
            self.reset()

    def note(self) -> str:
        """Return what is wrong with how the object is held; empty where nothing is."""
        if self.fault is GripFault.OSCILLATES:
            return f'the object oscillates: the gain is softened to {self.gains.pose:.3g} 1/s'
        if self.fault is not None:
            return f'{self.fault.value}: open the grip, or set squeeze_force again to go on'
        if self._estimate is None and self._trim:
            return f'no fresh state estimate: the squeeze keeps its correction {self._trim:+.1f} N'
        return ''

    @property
    def squeeze(self) -> tuple[float, float] | None:
        """Return mean normal force and its standard deviation, inf if not known [N]; or None."""
        if self.grasp is None:
            return None
        estimate = self._estimate
        if estimate is None or math.isnan(estimate.squeeze):
            return self._squeeze - self._trim, math.inf
        return estimate.squeeze, estimate.squeeze_deviation

    def follow(self, config: Configuration, grip: Grip, elapsed: float) -> HoldStatus:
        """
        Take model and reference to now, and the load from where the object was measured.

        Contacts that stick roll with the tubes, so that the model follows the configuration. It
        starts again from the measured pose where it has lost the object.

        :param config: where the robot is.
        :param grip: how it holds the object, which is where it was measured.
        :param elapsed: since the cycle before, for which its command held [s].
        :return: whether the object is held in the model; if not, why.
        :raises GainError: see `choose_gain`.
        :raises GraspError: see `find_contacts`.
        :raises ConfigurationError: the configuration is singular.
        :raises StructureError: see `structure_of`.
        """
        friction, before, self._elapsed = self.settings.friction, self.grasp, elapsed
        if self.reference is not None:
            self.reference = self.reference + elapsed * self._velocity
        if before is not None and before.tubes.pressure != self._pressures:
            before = replace(before, tubes=before.tubes._replace(pressure=self._pressures))
        grasp = None if before is None else roll_grip(before, config, self._wrench(before))
        hold = HoldStatus.NO_BALANCE if grasp is None else grasp.hold(friction)
        if before is not None and grasp is not None and hold is HoldStatus.HELD:
            found = sensitivity(grasp, friction)
            if found is not None:
                self._learn(before, grasp, found, elapsed)
                self._rows = grip_jacobian(config, grip)
                self._observe(grasp, found, grip, elapsed)
                return HoldStatus.HELD
        again = self._start(config, grip)
        if before is not None and self.fault is None:
            if hold is HoldStatus.SLIPS:
                self.fault = GripFault.SLIPPED
            elif again is not HoldStatus.HELD:
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
        if self.grasp is None:
            raise ValueError('follow comes before solve')
        if self.fault in STILL:
            still = np.zeros(len(self.grasp.config.roller_positions))
            return RollerCommand(still, np.zeros(3), 0.0, HALTS[self.fault])
        missing = self.gains.squeeze * (self.settings.force + self._trim - self._squeeze)
        most = self.settings.max_force_rate
        opening = (max(-most, min(missing, most)) - self._drift[3]) / self._slope
        if self.fault is not None:
            held = solve(np.zeros(3), opening)
            return replace(held, scale=0.0, status=HALTS[self.fault])
        twist, correction = np.asarray(twist), self._correction(period)
        command = _solve_within_limits(twist + correction, opening, solve)
        free = self._margin(self.grasp, np.zeros(3)) - LEFT_MARGIN * self._squeeze
        share = self._usage.margin_share(command, period, free) if twist.any() else 1.0
        if share < 1.0:
            slowed = _solve_within_limits(share * twist + correction, opening, solve)
            command = replace(
                slowed,
                scale=share * slowed.scale,
                status=Status.SLOWED_SLIP_MARGIN,
                limiting=(*slowed.limiting, 'the slip margin'),
            )
        most, rate = self.settings.max_utilisation, self.settings.utilisation_rate
        return self._usage.limit_utilisation(command, period, most, rate)

    def advance(self, twist: Array, command: RollerCommand) -> None:
        """
        Take note of what is carried out of a twist, which moves the reference from now on.

        :param twist: (3,) commanded [m/s, rad/s].
        :param command: the command of this cycle; in a direction other than the twist's it ends
            the reference.
        """
        if command.status in (Status.UNREACHABLE, Status.SLIDING):
            self.reference = None
        self._asked = np.asarray(twist)
        self._velocity = command.scale * self._asked

    def _correction(self, period: float) -> Array:
        """Return the twist (3,) that takes pose errors and what the rows of (19) miss away."""
        if self.reference is None:
            self.reference = self._pose + self.load.bias
        # A command that holds for longer than the period must not correct too much.
        gain = min(self.gains.pose, 0.5 / max(period, self._elapsed))
        error = pose_difference(self.reference, self._pose + self.load.bias)
        return gain * error - self._drift[:3]

    def _learn(
        self, before: HeldGrip, grasp: HeldGrip, given: Sensitivity, elapsed: float
    ) -> None:
        """Take in what the last travel did beyond the rows of (19) and loads, and to the tubes."""
        travel = grasp.config.roller_positions - before.config.roller_positions
        moved, opened = self._rows[:3] @ travel, self._rows[3] @ travel
        loaded = grasp.wrench - before.wrench
        change = pose_difference(grasp.pose, before.pose)
        pressed = grasp.squeeze - before.squeeze - self._slope * opened - given.squeeze @ loaded
        beyond = np.append(change - moved - given.pose @ loaded, pressed)
        self._drift = beyond / elapsed if elapsed > 0.0 else np.zeros(4)
        # A load that changed the margin is not to be taken for what the travel did.
        margin = self._margin(grasp, np.zeros(3)) - self._margin(before, loaded)
        self._usage.learn(grasp, margin, travel)

    def _start(self, config: Configuration, grip: Grip) -> HoldStatus:
        """Begin with the equilibrium near the measured pose."""
        self.load = LoadEstimate(self.settings.load)
        found = attach_model(config, grip, self._pressures)
        if isinstance(found, HoldStatus):
            self.grasp = None
            return found
        self._choose_gains(found)
        given = sensitivity(found, self.settings.friction)
        if given is None:
            self.grasp = None
            return HoldStatus.UNSTABLE
        self._take(found, given, np.zeros(3))
        offset = pose_difference(grip.body.pose, found.pose)
        self.load.offset = self.load.bias = offset
        self._first, self._averaged = [offset], 0.0
        self._measured = np.array(grip.body.pose)
        self._watch = GripWatch(self.frequency)
        # What a load explains is no slip.
        left = offset - given.pose @ self.load.most_probable(offset, given.pose, found.arm)
        self._watch.first = np.array((offset, left)) * (1.0, 1.0, found.arm)
        self._usage = UsageLimits(found)
        self._rows, self._drift = grip_jacobian(config, grip), np.zeros(4)
        return found.hold(self.settings.friction)

    def _choose_gains(self, grasp: HeldGrip) -> None:
        """Let the gains follow from the frequency."""
        settings, description = self.settings, grasp.config.robot.description
        self.frequency = settings.frequency or lowest_frequency(grasp)
        gain = choose_gain(
            self.frequency, description.damping_ratio, settings.pose_gain, settings.force_gain
        )
        self.gains = gains_of(self._softening * gain)

    def _observe(self, grasp: HeldGrip, given: Sensitivity, grip: Grip, elapsed: float) -> None:
        """Take in where the object was measured and where the model has it."""
        self._choose_gains(grasp)
        measured, friction = grip.body.pose, self.settings.friction
        offset = pose_difference(measured, grasp.pose)
        moved = given.pose @ self.load.wrench
        borne = True
        if self._first:
            self._take(grasp, given, np.zeros(3))
            self._average(grasp, given, grip, offset, elapsed)
        else:
            least = LEFT_MARGIN * grasp.squeeze
            loaded, borne = self.load.update(
                offset,
                given.pose,
                grasp.arm,
                elapsed,
                self.gains,
                lambda more: grasp.slip_margin(friction, more) > least,
            )
            self._take(grasp, given, loaded)
        self._follow_estimate(elapsed)
        even, error = np.array([1.0, 1.0, grasp.arm]), np.zeros(3)
        if self.reference is not None:
            error = pose_difference(self.reference, measured)
        asked, went = elapsed * self._asked, pose_difference(measured, self._measured)
        self._measured = np.array(measured)
        lengths = (offset + moved, offset, error, asked, went)
        poses = PoseComparison(*(even * each for each in lengths), borne)
        self._look_for_faults(poses, elapsed)

    def _average(
        self, grasp: HeldGrip, given: Sensitivity, grip: Grip, offset: Array, elapsed: float
    ) -> None:
        """Take in a pose of the first while; at its end begin with the load or the mean."""
        self._first.append(offset)
        self._averaged += elapsed
        first, even = np.array(self._first), np.array([1.0, 1.0, grasp.arm])
        self.load.offset = self.load.bias = first.mean(axis=0)
        if self._averaged < self.gains.filter_time:
            return
        self._first.clear()
        # A load moves the object once; noise moves it in each cycle.
        noise = np.median(np.abs(np.diff(even * first, axis=0)), axis=0).max()
        known = len(first) >= FEWEST
        if known:
            self._watch.noise = float(noise)
        if not known or noise < self.settings.load.pose_error:
            loaded = self.load.begin(self.load.offset, given.pose, grasp.arm)
            self._take(grasp, given, loaded)
            return
        mean = Pose(*(np.array(grasp.pose) + self.load.offset))
        there = replace(grip, body=grip.body.moved_to(mean))
        found = attach_model(grasp.config, there, self._pressures)
        if isinstance(found, HoldStatus):
            return
        given = sensitivity(found, self.settings.friction)
        if given is None:
            return
        loaded = self.load.begin(pose_difference(mean, found.pose), given.pose, grasp.arm)
        self._take(found, given, loaded)
        self._watch.first[0] += even * pose_difference(grasp.pose, found.pose)
        self._watch.first[1] = even * self.load.bias

    def _follow_estimate(self, elapsed: float) -> None:
        """Move the target by what the model has more of the squeeze than an estimate."""
        estimate = self._estimate
        if estimate is None or not estimate.squeeze_deviation <= TRUSTED * self.settings.force:
            return
        passed = -math.expm1(-elapsed / TRIM_TIME)
        self._trim += passed * (self._squeeze - estimate.squeeze - self._trim)

    def _look_for_faults(self, poses: PoseComparison, elapsed: float) -> None:
        """Watch the grip; after an oscillation stand still for a while, and go on more softly."""
        self._rest = max(self._rest - elapsed, 0.0)
        if self.fault is GripFault.OSCILLATES and self._rest == 0.0:
            self.fault = None
            self._watch.forget_swings()
        if self.fault is not None:
            return
        self.fault = self._watch.update(poses, elapsed)
        if self.fault is GripFault.OSCILLATES:
            self._rest, self._softening = REST_TIME, 0.5 * self._softening

    def _take(self, grasp: HeldGrip, given: Sensitivity, loaded: Array) -> None:
        """Go on with an evaluated model, and a load (3,) that came since [N]."""
        self.grasp, self._slope, self.slip_margin = grasp, given.slope, given.slip_margin
        self._pose = np.array(grasp.pose) + given.pose @ loaded
        self._squeeze = grasp.squeeze + float(given.squeeze @ loaded)

    def _margin(self, grasp: HeldGrip, more: Array) -> float:
        """Return the slip margin without a load or with more (3,); no load is trusted to help."""
        friction = self.settings.friction
        return min(grasp.slip_margin(friction, each) for each in (more, -grasp.wrench))

    def _wrench(self, grasp: HeldGrip) -> Array:
        """Return the estimated wrench (fx, fy, m) [N, N m]."""
        return self.load.wrench * (1.0, 1.0, grasp.arm)


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
