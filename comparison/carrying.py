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
from dataclasses import dataclass
import math
from typing import Protocol

from isotruss_ros.core import (
    Configuration,
    ConvexObject,
    Grip,
    Pose,
    RollerState,
    RollingGrip,
    solve_twist,
    solve_twist_ahead,
    StampedInput,
    Status,
    TwistServo,
)
from isotruss_ros.core.control.load_estimate import LoadSettings
from isotruss_ros.core.control.squeeze_control import SqueezeControl, SqueezeSettings
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.demo.path import Phase
from isotruss_ros.mujoco_plant.options import LOAD_TIME, POSE_GAIN
from isotruss_ros.mujoco_plant.plant import MujocoPlant
import numpy as np

#: Commands per second.
RATE = 50.0
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
    :param grasp: where it holds the object.
    """

    def __init__(self, config: Configuration, grasp: Grasp) -> None:
        self._config, self._held = config, RollingGrip.attach(config, grasp)

    def command(self, plant: MujocoPlant, twist: Array, error: Array, time: float) -> Array:
        """Return roller velocities for the middle of the cycle, see `Steering`."""
        self._config = self._config.moved_to(plant.travel)
        grasp = self._held.moved_to(self._config)
        found = solve_twist_ahead(self._config, grasp, twist, 0.5 / RATE)
        return found.roller_velocities


class Feedback:
    """
    The same program, for the measured pose, which is brought back to the path.

    :param config: where the robot is at first.
    :param grasp: where it holds the object.
    :param gain: share of the error that is corrected in a second [1/s].
    """

    def __init__(self, config: Configuration, grasp: Grasp, gain: float = 1.0) -> None:
        self._config, self._grasp, self._gain = config, grasp, gain

    def command(self, plant: MujocoPlant, twist: Array, error: Array, time: float) -> Array:
        """Return roller velocities for the measured pose, see `Steering`."""
        self._config = self._config.moved_to(plant.travel)
        grasp = Grip.at_module(
            config.robot,
            self._grasp.module,
            ConvexObject.disc(plant.object_pose()[:2], self._grasp.diameter),
        )
        found = solve_twist(self._config, grasp, twist + self._gain * error)
        return found.roller_velocities


class Regulated:
    """
    The servo of the node `manipulation`, with the model of the held object in its loop.

    :ivar control: has the model.
    :ivar statuses: of its commands.
    :param config: where the robot is at first.
    :param grasp: where it holds the object, or with which members.
    :param squeeze: mean normal force that is regulated [N].
    :param friction: coefficient between tube and object.
    """

    def __init__(
        self, config: Configuration, grasp: Grip, squeeze: float, friction: float
    ) -> None:
        load = LoadSettings(time=LOAD_TIME)
        self.control = SqueezeControl(
            SqueezeSettings(squeeze, friction, pose_gain=POSE_GAIN, load=load)
        )
        self.statuses: set[Status] = set()
        self.messages: set[str] = set()
        self._servo = TwistServo(config.robot, *_short_form(grasp), 1.0 / RATE, 0.5)
        if isinstance(grasp, Grip):
            self._servo.members, self._servo.friction = grasp.members, friction
            self._servo.body = grasp.body
        self._servo.squeeze = self.control

    def command(self, plant: MujocoPlant, twist: Array, error: Array, time: float) -> Array:
        """Return roller velocities, see `Steering`; zero where the servo halts."""
        servo, pose = self._servo, plant.object_pose()
        state = RollerState(plant.travel, plant.speeds)
        servo.rollers, servo.pose = StampedInput(state, time), StampedInput(pose, time)
        servo.twist = StampedInput(tuple(twist), time)
        decision = servo.decide(time)
        self.statuses.add(decision.command.status)
        if decision.message:
            self.messages.add(decision.message)
        return decision.command.roller_velocities


def _short_form(grasp: Grip) -> tuple[str, float]:
    """Return module and diameter of the short form; they do not count in a grip."""
    return ('', 1.0) if isinstance(grasp, Grip) else (grasp.module, grasp.diameter)


@dataclass(frozen=True)
class Carried:
    """
    What became of an object on its path.

    :ivar times: (n,) [s].
    :ivar poses: (n, 3) of the object [m, rad].
    :ivar goals: (n, 3) where it should have been [m, rad].
    :ivar squeezes: (n,) mean normal force of the members [N].
    :ivar frictions: (n,) largest friction used |T| / N [-].
    """

    times: Array
    poses: Array
    goals: Array
    squeezes: Array
    frictions: Array

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
