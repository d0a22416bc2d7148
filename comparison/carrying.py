# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""An object carried along a path of twists, by three ways to command the rollers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
import math
from typing import Protocol

from isotruss_ros.core import (
    Configuration,
    Grip,
    Pose,
    RollingGrip,
    solve_twist,
    solve_twist_ahead,
    Status,
    TwistServo,
)
from isotruss_ros.core.control.inputs import RollerState, StampedInput
from isotruss_ros.core.control.squeeze_control import SqueezeControl, SqueezeSettings
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.demo.path import Phase
from isotruss_ros.mujoco_plant.options import PlantOptions
from isotruss_ros.mujoco_plant.plant import MujocoPlant
import numpy as np

#: Commands per second.
RATE = 100.0
#: An object farther than this from where it should be was lost [m].
LOST = 0.1


class Steering(Protocol):
    """Commands the rollers."""

    def command(self, plant: MujocoPlant, twist: Array, error: Array, time: float) -> Array:
        """
        Return roller velocities (r,) [m/s].

        :param plant: as it is now.
        :param twist: (3,) of the object on its path [m/s, rad/s].
        :param error: (3,) by which the object is short of its path [m, rad].
        :param time: since the start [s].
        """
        ...


class OpenLoop:
    """
    The paper's program for rigid tubes: nobody looks where the object is.

    :param config: where the robot is at first.
    :param grip: how it holds the object.
    """

    def __init__(self, config: Configuration, grip: Grip) -> None:
        self._rolling = RollingGrip.attach(config, grip)

    def command(self, plant: MujocoPlant, twist: Array, error: Array, time: float) -> Array:
        """Return roller velocities for the middle of the cycle, see `Steering`."""
        self._rolling = self._rolling.moved_to(self._rolling.config.moved_to(plant.travel))
        found = solve_twist_ahead(self._rolling.config, self._rolling.grip, twist, 0.5 / RATE)
        return found.roller_velocities


class Feedback:
    """
    The same program, for the measured pose, which is brought back to the path.

    :param config: where the robot is at first.
    :param grip: how it holds the object, which may be anywhere.
    :param gain: share of the error that is corrected in a second [1/s].
    :param opening_rate: of the distance between the members [m/s].
    """

    def __init__(
        self, config: Configuration, grip: Grip, gain: float = 1.0, opening_rate: float = 0.0
    ) -> None:
        self._config, self._grip = config, grip
        self._gain, self._opening_rate = gain, opening_rate

    def command(self, plant: MujocoPlant, twist: Array, error: Array, time: float) -> Array:
        """Return roller velocities for the measured pose, see `Steering`."""
        self._config = self._config.moved_to(plant.travel)
        grip = replace(self._grip, body=self._grip.body.moved_to(plant.object_pose()))
        wanted = twist + self._gain * error
        found = solve_twist(self._config, grip, wanted, opening_rate=self._opening_rate)
        return found.roller_velocities


class Regulated:
    """
    The servo of the node `manipulation`, with the model of the held object in its loop.

    :ivar control: has the model.
    :ivar statuses: of its commands.
    :ivar messages: with them.
    :ivar scale: part of the last twist that was carried out.
    :param config: where the robot is at first.
    :param grip: how it holds the object.
    :param squeeze: mean normal force that is regulated [N].
    :param noise: standard deviations of the measured poses [m, rad], and their seed.
    """

    def __init__(
        self,
        config: Configuration,
        grip: Grip,
        squeeze: float,
        noise: tuple[float, float, int] = (0.0, 0.0, 0),
    ) -> None:
        along, turned, seed = noise
        self._noise, self._rng = np.array([along, along, turned]), np.random.default_rng(seed)
        self.scale = 0.0
        self.control = SqueezeControl(SqueezeSettings(squeeze, grip.friction))
        self.statuses: set[Status] = set()
        self.messages: set[str] = set()
        # Module and diameter are the short form, for which the grip stands.
        self._servo = TwistServo(config.robot, '', 1.0, 1.0 / RATE, 0.5)
        self._servo.members, self._servo.friction = grip.members, grip.friction
        body = grip.body
        if body.mass is None:
            body = replace(body, mass=PlantOptions().object_mass)
        self._servo.body = body
        self._servo.squeeze = self.control

    def command(self, plant: MujocoPlant, twist: Array, error: Array, time: float) -> Array:
        """Return roller velocities, see `Steering`; zero where the servo halts."""
        noise = self._noise * self._rng.standard_normal(3)
        servo, pose = self._servo, Pose(*(plant.object_pose() + noise).tolist())
        state = RollerState(plant.travel, plant.speeds)
        servo.rollers, servo.pose = StampedInput(state, time), StampedInput(pose, time)
        servo.twist = StampedInput(tuple(twist), time)
        decision = servo.decide(time)
        self.statuses.add(decision.command.status)
        self.scale = decision.command.scale
        if decision.message:
            self.messages.add(decision.message)
        return decision.command.roller_velocities


@dataclass(frozen=True)
class Carried:
    """What became of an object on its path."""

    times: Array  #: (n,) [s]
    poses: Array  #: (n, 3) of the object [m, rad]
    goals: Array  #: (n, 3) where it should have been [m, rad]
    squeezes: Array  #: (n,) mean normal force of the members [N]
    frictions: Array  #: (n,) largest friction used |T| / N [-]

    @property
    def position_error(self) -> float:
        """Return the largest distance from the path [m]."""
        return float(np.hypot(*(self.poses - self.goals)[:, :2].T).max())

    @property
    def angle_error(self) -> float:
        """Return the largest error of the orientation [rad]."""
        return float(np.abs((self.poses - self.goals)[:, 2]).max())

    @property
    def lost(self) -> bool:
        """Return whether the object was lost."""
        return self.position_error > LOST


def carry(
    plant: MujocoPlant,
    steering: Steering,
    phases: Sequence[Phase],
    watch: Callable[[float], None] | None = None,
) -> Carried:
    """
    Carry the object along a path; where it is lost, it ends.

    :param plant: holds the object.
    :param steering: commands the rollers.
    :param phases: of the path, one after the other.
    :param watch: called after every command with the time since the start [s].
    """
    goal = np.array(plant.object_pose())
    rows: list[tuple[float, Pose, Array, float, float]] = []
    cycle, start = 1.0 / RATE, plant.time
    for phase in phases:
        for k in range(round(phase.duration * RATE)):
            now = plant.time - start
            middle = np.array(phase.twist((k + 0.5) * cycle))
            error = goal - np.array(plant.object_pose())
            plant.advance(cycle, steering.command(plant, middle, error, now))
            goal = goal + cycle * middle
            forces = plant.contact_forces().values()
            squeeze = 0.5 * sum(force.normal for force in forces)
            used = max((abs(f.friction) / max(f.normal, 1e-9) for f in forces), default=math.inf)
            rows.append((now + cycle, plant.object_pose(), goal, squeeze, used))
            if watch is not None:
                watch(now + cycle)
            if np.hypot(*(goal - np.array(plant.object_pose()))[:2]) > LOST:
                return _stack(rows)
    return _stack(rows)


def _stack(rows: Sequence[tuple[float, Pose, Array, float, float]]) -> Carried:
    times, poses, goals, squeezes, frictions = zip(*rows, strict=True)
    return Carried(
        np.array(times), np.array(poses), np.array(goals), np.array(squeezes), np.array(frictions)
    )
