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
the last cycle is expected of the next one as well.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
import math

from isotruss_ros.core.control.held_model import attach_model, Sensitivity, sensitivity
from isotruss_ros.core.control.load_estimate import LoadEstimate, LoadSettings
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.held_utilisation import held_utilisation
from isotruss_ros.core.holding.hold_status import HoldStatus
from isotruss_ros.core.holding.roll_grip import roll_contacts, roll_grip
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.manipulation.solve_twist import RollerCommand
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Travel of the rollers in a cycle that tells of the utilisation; shorter ones tell less [m].
TELLING = 1e-4
#: At this utilisation a tube has folded: more is not told apart.
FOLDED = 2.0

#: Solves the program for a twist (3,) and a rate of the grip's opening [m/s].
Solve = Callable[[Array, float], RollerCommand]


@dataclass(frozen=True)
class SqueezeSettings:
    """
    What the squeeze is to be, and how quickly it gets there.

    :ivar force: mean normal force of the grasping members, positive [N].
    :ivar friction: coefficient between tube and object.
    :ivar gain: share of the missing force that is made up for in a second [1/s].
    :ivar max_force_rate: the squeeze changes no quicker than this [N/s].
    :ivar pose_gain: share of the object's error in the model that is corrected in a second [1/s].
        The default, as that of `load`, is for robots whose masses do not count; others swing.
    :ivar bias_gain: share of what the model does not explain of the measured pose that is
        corrected in a second [1/s].
    :ivar min_slip_margin: below this margin a message warns [N].
    :ivar max_utilisation: of the moment at which tubes wrinkle; commands that lead toward it are
        slowed, and beyond it only those that lead away are carried out [-].
    :ivar utilisation_rate: share of what is left to that bound that is used in a second [1/s].
    :ivar load: what loads and errors are expected.
    """

    force: float
    friction: float
    gain: float = 5.0
    max_force_rate: float = 10.0
    pose_gain: float = 20.0
    bias_gain: float = 2.0
    min_slip_margin: float = 0.0
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
    :param settings: what the squeeze is to be.
    """

    def __init__(self, settings: SqueezeSettings) -> None:
        self.settings = settings
        self.reset()

    def reset(self) -> None:
        """Forget how and where the object is held: both follow from the next measured pose."""
        self.grasp: HeldGrip | None = None
        self.load = LoadEstimate(self.settings.load)
        self.reference: Array | None = None
        self.slip_margin = 0.0
        self._velocity, self._elapsed = np.zeros(3), 0.0
        self._pose, self._squeeze, self._slope = np.zeros(3), 0.0, 0.0
        self._used = self._used_by_travel = np.zeros(0)
        self._rows, self._drift = np.zeros((4, 0)), np.zeros(4)

    def warning(self) -> str:
        """Return what is wrong with how the object is held; empty where nothing is."""
        margin, least = self.slip_margin, self.settings.min_slip_margin
        if self.grasp is None or margin >= least:
            return ''
        return f'the slip margin of {margin:.3g} N is below {least:.3g} N'

    def follow(self, config: Configuration, grip: Grip, elapsed: float) -> HoldStatus:
        """
        Take model and reference to now, and the load from where the object was measured.

        Contacts that stick roll with the tubes, so that the model follows the configuration. It
        starts again from the measured pose where it has lost the object.

        :param config: where the robot is.
        :param grip: how it holds the object, which is where it was measured.
        :param elapsed: since the cycle before, for which its command held [s].
        :return: whether the object is held in the model; if not, why.
        :raises GraspError: see `find_contacts`.
        :raises ConfigurationError: the configuration is singular.
        :raises StructureError: see `structure_of`.
        """
        friction, before, self._elapsed = self.settings.friction, self.grasp, elapsed
        if self.reference is not None:
            self.reference = self.reference + elapsed * self._velocity
        grasp = None if before is None else roll_grip(before, config, self._wrench(before))
        if before is not None and grasp is not None and grasp.hold(friction) is HoldStatus.HELD:
            found = sensitivity(grasp, friction)
            if found is not None:
                self._learn_drift(before, grasp, found, elapsed)
                self._learn_utilisation(before, grasp)
                self._rows = grip_jacobian(config, grip)
                self._observe(grasp, found, grip.body.pose, elapsed)
                return HoldStatus.HELD
        return self._start(config, grip)

    def solve(self, twist: Array, period: float, solve: Solve) -> RollerCommand:
        """
        Return the command that moves the object as asked and brings the squeeze to its target.

        :param twist: (3,) vx, vy [m/s], omega [rad/s] of the object in the robot frame.
        :param period: for which the command holds, positive [s].
        :param solve: the twist program.
        """
        if self.grasp is None:
            raise ValueError('follow comes before solve')
        settings = self.settings
        if self.reference is None:
            self.reference = self._pose + self.load.bias
        error = _difference(self.reference, self._pose + self.load.bias)
        # A command that holds for longer than the period must not correct too much.
        longest = max(period, self._elapsed)
        wanted = twist + min(settings.pose_gain, 0.5 / longest) * error
        missing = settings.gain * (settings.force - self._squeeze)
        rate = max(-settings.max_force_rate, min(missing, settings.max_force_rate))
        wanted, rate = wanted - self._drift[:3], rate - self._drift[3]
        return self._limit_utilisation(solve(wanted, rate / self._slope), period)

    def advance(self, twist: Array, command: RollerCommand) -> None:
        """
        Take note of what is carried out of a twist, which moves the reference from now on.

        :param twist: (3,) commanded [m/s, rad/s].
        :param command: the command of this cycle; in a direction other than the twist's it ends
            the reference.
        """
        if command.status in (Status.UNREACHABLE, Status.SLIDING):
            self.reference = None
        self._velocity = command.scale * np.asarray(twist)

    def _learn_drift(
        self, before: HeldGrip, grasp: HeldGrip, given: Sensitivity, elapsed: float
    ) -> None:
        """Take in how pose and squeeze changed in a second beyond the rows of (19), and loads."""
        travel = grasp.config.roller_positions - before.config.roller_positions
        moved, opened = self._rows[:3] @ travel, self._rows[3] @ travel
        loaded = grasp.wrench - before.wrench
        change = _difference(np.array(grasp.pose), np.array(before.pose))
        pressed = grasp.squeeze - before.squeeze - self._slope * opened - given.squeeze @ loaded
        beyond = np.append(change - moved - given.pose @ loaded, pressed)
        self._drift = beyond / elapsed if elapsed > 0.0 else np.zeros(4)

    def _learn_utilisation(self, before: HeldGrip, grasp: HeldGrip) -> None:
        """Take in by how much the last travel changed the utilisation (least mean squares)."""
        travel = grasp.config.roller_positions - before.config.roller_positions
        used = np.minimum(held_utilisation(grasp), FOLDED)
        missed = float(used.max() - self._used.max() - self._used_by_travel @ travel)
        known = missed / float(travel @ travel + TELLING**2)
        self._used, self._used_by_travel = used, self._used_by_travel + known * travel

    def _limit_utilisation(self, command: RollerCommand, period: float) -> RollerCommand:
        """Return a command, slowed where it would use too much of what is left of the tubes."""
        settings, member = self.settings, int(self._used.argmax())
        more = period * float(self._used_by_travel @ command.roller_velocities)
        free = settings.max_utilisation - float(self._used[member])
        left = max(period * settings.utilisation_rate * free, 0.0)
        if more <= left:
            return command
        share = left / more
        name = f'member {self.grasp.config.robot.member_names[member]}'
        return replace(
            command,
            roller_velocities=share * command.roller_velocities,
            achieved_twist=share * command.achieved_twist,
            scale=share * command.scale,
            status=Status.SLOWED_UTILISATION,
            limiting=tuple(dict.fromkeys((*command.limiting, name))),
        )

    def _start(self, config: Configuration, grip: Grip) -> HoldStatus:
        """Begin with the equilibrium near the measured pose."""
        self.load = LoadEstimate(self.settings.load)
        found = attach_model(config, grip)
        if isinstance(found, HoldStatus):
            self.grasp = None
            return found
        grasp = self._explain(found, grip.body.pose)
        given = sensitivity(grasp, self.settings.friction)
        if given is None:
            self.grasp = None
            return HoldStatus.UNSTABLE
        self._take(grasp, given, np.zeros(3))
        self._used = np.minimum(held_utilisation(grasp), FOLDED)
        self._used_by_travel = np.zeros(len(config.roller_positions))
        self._rows, self._drift = grip_jacobian(config, grip), np.zeros(4)
        return found.hold(self.settings.friction)

    def _explain(self, found: HeldGrip, measured: Pose) -> HeldGrip:
        """Return the equilibrium under the load that explains where the object was measured."""
        given = sensitivity(found, self.settings.friction)
        if given is None:
            return found
        offset = _difference(np.array(measured), np.array(found.pose))
        # At once: so that the object is wanted where it is, and not where the model has it.
        self.load.update(offset, given.pose, found.arm, math.inf, 1.0)
        # At the same contacts: the next cycle finds which of them change.
        contacts, wrench = found.contacts, self.load.wrench
        loaded = roll_contacts(found, found.config, contacts, found.anchors, found.angles, wrench)
        if loaded is None or loaded.hold(self.settings.friction) is not HoldStatus.HELD:
            self.load.wrench, self.load.bias = np.zeros(3), offset
            return found
        return loaded

    def _observe(
        self, grasp: HeldGrip, given: Sensitivity, measured: Pose, elapsed: float
    ) -> None:
        """Take the load from where the object was measured and where the model has it."""
        offset = _difference(np.array(measured), np.array(grasp.pose))
        gain = self.settings.bias_gain
        self._take(grasp, given, self.load.update(offset, given.pose, grasp.arm, elapsed, gain))

    def _take(self, grasp: HeldGrip, given: Sensitivity, loaded: Array) -> None:
        """Go on with an evaluated model, and a load (3,) that came since [N]."""
        self.grasp, self._slope, self.slip_margin = grasp, given.slope, given.slip_margin
        self._pose = np.array(grasp.pose) + given.pose @ loaded
        self._squeeze = grasp.squeeze + float(given.squeeze @ loaded)

    def _wrench(self, grasp: HeldGrip) -> Array:
        """Return the estimated wrench (fx, fy, m) [N, N m]."""
        return self.load.wrench * (1.0, 1.0, grasp.arm)


def _difference(pose: Array, other: Array) -> Array:
    """Return pose minus other, the angle in (-pi, pi] (3,) [m, rad]."""
    away = pose - other
    away[2] = math.remainder(away[2], 2.0 * math.pi)
    return away
