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
elastic tubes do to the object's pose is predicted by the model and corrected in the same cycle.
The model is evaluated where the command leads, in every few cycles; from there to where the robot
comes to be it goes on by the rows of (19), and by what the model does beyond them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
import math

from isotruss_ros.core.control.held_model import (
    attach_model,
    motion_of,
    Sensitivity,
    sensitivity,
)
from isotruss_ros.core.control.load_estimate import LoadEstimate, LoadSettings
from isotruss_ros.core.control.model_trend import ModelTrend
from isotruss_ros.core.grasping.held_grip import HeldGrip
from isotruss_ros.core.grasping.held_utilisation import held_utilisation
from isotruss_ros.core.grasping.hold_status import HoldStatus
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.solve_twist import RollerCommand
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Below this share of the twist the limits decide where the object goes, not the model.
MIN_SCALE = 0.05
#: From this share of the largest utilisation on, the model is evaluated in every cycle.
CAREFUL_FROM = 0.8

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
    :ivar model_period: the model is evaluated this often while the motion stays alike [s].
    :ivar near: farther from where it was evaluated last the model is evaluated again [m].
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
    model_period: float = 0.02
    near: float = 1e-3
    load: LoadSettings = field(default_factory=LoadSettings)


class SqueezeControl:
    """
    Regulates squeeze and pose of an object that the robot holds.

    :ivar grasp: the model of how it is held where it was evaluated last; None before that.
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
        self._trend: ModelTrend | None = None
        self._rollers, self._age = np.zeros(0), 0.0  # last command; time since the evaluation
        self._pose, self._squeeze = np.zeros(3), 0.0
        self._slope = self._utilisation = 0.0

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
        friction, grasp, self._elapsed = self.settings.friction, self.grasp, elapsed
        self._age += elapsed
        if self.reference is not None:
            self.reference = self.reference + elapsed * self._velocity
        if grasp is not None:
            travel = config.roller_positions - grasp.config.roller_positions
            if float(np.abs(travel).max()) > self.settings.near:
                grasp = grasp.moved_to(config, self._wrench(grasp))
                travel = np.zeros(len(travel))
        if grasp is not None and grasp.hold(friction) is HoldStatus.HELD:
            found = sensitivity(grasp, friction)
            if found is not None:
                self._observe(grasp, found, config, grip, travel, elapsed)
                return HoldStatus.HELD
        return self._start(config, grip)

    def solve(self, twist: Array, period: float, solve: Solve) -> RollerCommand:
        """
        Return the command that moves the object as asked and brings the squeeze to its target.

        :param twist: (3,) vx, vy [m/s], omega [rad/s] of the object in the robot frame.
        :param period: for which the command holds, positive [s].
        :param solve: the twist program.
        :raises ConfigurationError: the robot cannot get to where the command leads.
        """
        if self.grasp is None:
            raise ValueError('follow comes before solve')
        grasp, settings = self.grasp, self.settings
        if self.reference is None:
            self.reference = self._pose + self.load.bias
        error = _difference(self.reference, self._pose + self.load.bias)
        # A command that holds for longer than the period must not correct too much.
        longest = max(period, self._elapsed)
        wanted = twist + min(settings.pose_gain, 0.5 / longest) * error
        missing = settings.gain * (settings.force - self._squeeze)
        rate = max(-settings.max_force_rate, min(missing, settings.max_force_rate))
        command = self._command(wanted, rate, solve)
        if command.scale < MIN_SCALE or not command.roller_velocities.any():
            return command
        self._rollers = command.roller_velocities / command.scale
        there = self._config.roller_positions + period * command.roller_velocities
        if not self._is_due(there, period):
            return command
        ahead = grasp.moved_to(self._config.moved_to(there), self._wrench(grasp))
        if ahead is None:
            return command
        since, self._age = max(self._age, period), 0.0
        self._trend = self._find_trend(grasp, ahead)
        keeps_direction = command.status is not Status.SLIDING
        command = self._command(wanted, rate, solve, keeps_direction)
        return self._limit_utilisation(command, ahead, period, since)

    def _command(
        self, wanted: Array, rate: float, solve: Solve, keeps_direction: bool = True
    ) -> RollerCommand:
        """
        Return the command for a twist and a change of the squeeze, less what comes by itself.

        :param wanted: (3,) twist of the object [m/s, rad/s].
        :param rate: change of the squeeze [N/s].
        :param solve: the twist program.
        :param keeps_direction: whether the limits admit the twist in its direction.
        """
        trend, slope = self._trend, self._slope
        if trend is None:
            return solve(wanted, rate / slope)
        along = trend.along(self._rollers)
        if keeps_direction:
            wanted = wanted - along * trend.pose
        return solve(wanted, (rate - along * trend.squeeze) / slope)

    def _find_trend(self, grasp: HeldGrip, ahead: HeldGrip) -> ModelTrend:
        """Return what lies between two evaluations beyond the rows of (19), and the load."""
        given = sensitivity(grasp, self.settings.friction)
        travel = ahead.config.roller_positions - grasp.config.roller_positions
        moved, opened = motion_of(self._config, self._held, travel)
        loaded = ahead.wrench - grasp.wrench
        pose = _difference(np.array(ahead.pose), np.array(grasp.pose))
        return ModelTrend.over(
            travel,
            pose - moved - given.pose @ loaded,
            ahead.squeeze - grasp.squeeze - given.slope * opened - float(given.squeeze @ loaded),
        )

    def _is_due(self, there: Array, period: float) -> bool:
        """Return whether the model must be evaluated where the command leads."""
        settings, trend = self.settings, self._trend
        if trend is None or self._age + 0.5 * period >= settings.model_period:
            return True
        if self._utilisation > CAREFUL_FROM * settings.max_utilisation:
            return True
        away = float(np.abs(there - self.grasp.config.roller_positions).max())
        return away > settings.near or not trend.fits(self._rollers)

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

    def _limit_utilisation(
        self, command: RollerCommand, ahead: HeldGrip, period: float, since: float
    ) -> RollerCommand:
        """
        Return a command, slowed where it would use too much of what is left of the tubes.

        :param command: for the cycle that begins now.
        :param ahead: the model where it leads.
        :param period: of the cycle [s].
        :param since: from the evaluation before to that one [s].
        """
        settings, used = self.settings, held_utilisation(ahead)
        before, after = self._utilisation, float(used.max())
        self.grasp, self._utilisation = ahead, after
        left = since * settings.utilisation_rate * (settings.max_utilisation - before)
        if after - before <= max(left, 0.0):
            return command
        share = max(left, 0.0) / (after - before)
        name = f'member {self._config.robot.member_names[int(used.argmax())]}'
        slowed = replace(
            command,
            roller_velocities=share * command.roller_velocities,
            achieved_twist=share * command.achieved_twist,
            scale=share * command.scale,
            status=Status.SLOWED_UTILISATION,
            limiting=tuple(dict.fromkeys((*command.limiting, name))),
        )
        travel = period * slowed.roller_velocities
        there = self._config.moved_to(self._config.roller_positions + travel)
        reached = ahead.moved_to(there, self._wrench(ahead))
        if reached is not None:
            self.grasp, self._utilisation = reached, float(held_utilisation(reached).max())
        return slowed

    def _start(self, config: Configuration, grip: Grip) -> HoldStatus:
        """Begin with the equilibrium near the measured pose."""
        self.load = LoadEstimate(self.settings.load)
        self._trend = None
        found = attach_model(config, grip)
        if isinstance(found, HoldStatus):
            self.grasp = None
            return found
        grasp = self._explain(found, grip.body.pose)
        self.grasp, self._config, self._held = grasp, config, grip
        self._pose, self._squeeze = np.array(grasp.pose), grasp.squeeze
        given = sensitivity(grasp, self.settings.friction)
        if given is None:
            self.grasp = None
            return HoldStatus.UNSTABLE
        self._slope, self.slip_margin = given.slope, given.slip_margin
        self._utilisation = float(held_utilisation(grasp).max())
        return found.hold(self.settings.friction)

    def _explain(self, found: HeldGrip, measured: Pose) -> HeldGrip:
        """Return the equilibrium under the load that explains where the object was measured."""
        given = sensitivity(found, self.settings.friction)
        if given is None:
            return found
        offset = _difference(np.array(measured), np.array(found.pose))
        # At once: so that the object is wanted where it is, and not where the model has it.
        self.load.update(offset, given.pose, found.arm, math.inf, 1.0)
        loaded = found.moved_to(found.config, self._wrench(found))
        if loaded is None or loaded.hold(self.settings.friction) is not HoldStatus.HELD:
            self.load.wrench, self.load.bias = np.zeros(3), offset
            return found
        return loaded

    def _observe(
        self,
        grasp: HeldGrip,
        given: Sensitivity,
        config: Configuration,
        grip: Grip,
        travel: Array,
        elapsed: float,
    ) -> None:
        """Take the model on by the rows of (19), and the load from what is left."""
        moved, opened = motion_of(config, grip, travel)
        pose, squeeze = np.array(grasp.pose) + moved, grasp.squeeze + given.slope * opened
        if self._trend is not None:
            along = self._trend.along(travel)
            pose, squeeze = pose + along * self._trend.pose, squeeze + along * self._trend.squeeze
        loaded = self.load.wrench - grasp.wrench  # since the model was evaluated
        offset = _difference(np.array(grip.body.pose), pose + given.pose @ loaded)
        loaded = loaded + self.load.update(
            offset, given.pose, grasp.arm, elapsed, self.settings.bias_gain
        )
        self.grasp, self._config, self._held = grasp, config, grip
        self._pose = pose + given.pose @ loaded
        self._squeeze = squeeze + float(given.squeeze @ loaded)
        self._slope = given.slope
        self.slip_margin = given.slip_margin

    def _wrench(self, grasp: HeldGrip) -> Array:
        """Return the estimated wrench (fx, fy, m) [N, N m]."""
        return self.load.wrench * (1.0, 1.0, grasp.arm)


def _difference(pose: Array, other: Array) -> Array:
    """Return pose minus other, the angle in (-pi, pi] (3,) [m, rad]."""
    away = pose - other
    away[2] = math.remainder(away[2], 2.0 * math.pi)
    return away
