# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Carry of an object along a path of twists, with three controllers of the rollers."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
import math
from typing import Protocol

from isotruss_ros.core import (
    Configuration,
    Grip,
    Pose,
    Robot,
    RollingGrip,
    solve_twist,
    solve_twist_ahead,
    Status,
    TwistServo,
)
from isotruss_ros.core.inputs import RollerState, StampedInput
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.servo.servo_settings import ServoSettings, SqueezeSettings
from isotruss_ros.core.servo.squeeze_control import SqueezeControl
from isotruss_ros.demo.path import Phase
from isotruss_ros.mujoco_plant.options import PlantOptions
from isotruss_ros.mujoco_plant.plant import MujocoPlant
import numpy as np
from numpy.typing import ArrayLike

#: Rate of the commands [Hz], and gain of the feedback [1/s].
RATE, GAIN = 100.0, 1.0
#: Position error at which an object counts as lost [m].
LOST = 0.1


class Steering(Protocol):
    """Protocol of a controller of a plant's rollers."""

    plant: MujocoPlant

    def command(self, twist: Array, error: Array) -> Array:
        """
        Return roller velocities (r,) [m/s].

        :param twist: (3,) twist of the object on its path [m/s, rad/s].
        :param error: (3,) pose error of the object relative to its path [m, rad].
        """
        ...


class OpenLoop:
    """
    Controller in open loop, which solves the paper's program for rigid tubes.

    :param plant: plant that holds the object.
    :param config: initial configuration.
    :param grip: grip of the object.
    """

    def __init__(self, plant: MujocoPlant, config: Configuration, grip: Grip) -> None:
        self.plant, self._rolling = plant, RollingGrip.attach(config, grip)

    def command(self, twist: Array, error: Array) -> Array:
        """Return roller velocities for the midpoint of the cycle, see `Steering`."""
        self._rolling = self._rolling.moved_to(self._rolling.config.moved_to(self.plant.travel))
        found = solve_twist_ahead(self._rolling.config, self._rolling.grip, twist, 0.5 / RATE)
        return found.roller_velocities


class Feedback:
    """
    Controller with feedback of the measured pose, which solves the paper's program.

    :param plant: plant that holds the object, or that closes on it.
    :param config: initial configuration.
    :param grip: grip of the object, at any pose.
    :param opening_rate: rate of the distance between the members [m/s].
    """

    def __init__(
        self, plant: MujocoPlant, config: Configuration, grip: Grip, opening_rate: float = 0.0
    ) -> None:
        self.plant, self._config, self._grip = plant, config, grip
        self._opening_rate = opening_rate

    def command(self, twist: Array, error: Array) -> Array:
        """Return roller velocities for the measured pose, see `Steering`."""
        self._config = self._config.moved_to(self.plant.travel)
        grip = replace(self._grip, body=self._grip.body.moved_to(self.plant.object_pose()))
        wanted = twist + GAIN * error
        found = solve_twist(self._config, grip, wanted, opening_rate=self._opening_rate)
        return found.roller_velocities


class Regulated:
    """
    Controller of the node `manipulation`, which is the servo with the model of the held object.

    :ivar servo: twist servo.
    :ivar statuses: statuses of the commands.
    :ivar messages: messages of the commands.
    :ivar scale: factor by which limits reduced the last twist [-].
    :param plant: plant that holds the object.
    :param robot: robot of the model.
    :param grip: grip of the object in the model.
    :param settings: settings of the squeeze control.
    :param noise: standard deviations of the measured poses [m, rad], and generator or seed.
    :param late: delay of the poses, in cycles [-].
    """

    def __init__(
        self,
        plant: MujocoPlant,
        robot: Robot,
        grip: Grip,
        settings: SqueezeSettings,
        noise: tuple[float, float, int | np.random.Generator] = (0.0, 0.0, 0),
        late: int = 0,
    ) -> None:
        along, turned, seed = noise
        self.plant, self.deviations = plant, np.array([along, along, turned])
        self.rng = np.random.default_rng(seed)
        self._seen: deque[StampedInput] = deque(maxlen=late + 1)
        self.scale = 0.0
        self.statuses: list[Status] = []
        self.messages: set[str] = set()
        if grip.body.mass is None:
            grip = replace(grip, body=replace(grip.body, mass=PlantOptions().object_mass))
        self.servo = TwistServo(robot, ServoSettings(grip, 1.0 / RATE, 0.5, squeeze=settings))

    @property
    def control(self) -> SqueezeControl:
        """Return the squeeze control of the servo."""
        return self.servo.squeeze

    def measure(self) -> tuple[RollerState, Pose]:
        """Return the current measurements of rollers and object."""
        noise = self.deviations * self.rng.standard_normal(3)
        pose = Pose(*(self.plant.object_pose() + noise).tolist())
        return RollerState(self.plant.travel, self.plant.speeds), pose

    def command(self, twist: Array, error: Array) -> Array:
        """Return roller velocities, see `Steering`; zero in a halt."""
        servo, time = self.servo, self.plant.time
        rollers, pose = self.measure()
        self._seen.append(StampedInput(pose, time))
        servo.receive(
            rollers=StampedInput(rollers, time),
            pose=self._seen[0],
            twist=StampedInput(tuple(twist), time),
        )
        decision = servo.decide(time)
        self.statuses.append(decision.command.status)
        self.scale = decision.command.scale
        if decision.message:
            self.messages.add(decision.message)
        return decision.command.roller_velocities

    def step(self, twist: Array) -> None:
        """
        Simulate one cycle.

        :param twist: (3,) twist of the object [m/s, rad/s].
        """
        self.plant.advance(1.0 / RATE, self.command(twist, np.zeros(3)))

    def run(self, duration: float, twist: ArrayLike = (0.0, 0.0, 0.0)) -> None:
        """
        Carry the object from rest to rest.

        :param duration: duration of the motion [s].
        :param twist: (3,) mean twist of the object [m/s, rad/s].
        """
        for rate in rates(duration):
            self.step(rate * np.array(twist))


def rates(duration: float) -> Array:
    """
    Return the speeds (n,) in all cycles of a motion from rest to rest, relative to the mean.

    :param duration: duration of the motion [s].
    """
    count = round(duration * RATE)
    return 1.0 - np.cos(2.0 * np.pi * (np.arange(count) + 0.5) / count)


def squeeze_in(plant: MujocoPlant) -> float:
    """
    Return the mean normal force on the object [N]; zero with fewer than two contacts.

    :param plant: plant that holds the object.
    """
    forces = [force.normal for force in plant.contact_forces().values()]
    pressing = [force for force in forces if force > 0.1]
    return float(np.mean(pressing)) if len(pressing) > 1 else 0.0


@dataclass(frozen=True)
class Carried:
    """Result of a carry."""

    times: Array  #: (n,) times [s]
    poses: Array  #: (n, 3) poses of the object [m, rad]
    goals: Array  #: (n, 3) desired poses [m, rad]
    squeezes: Array  #: (n,) mean normal force of the members [N]
    frictions: Array  #: (n,) largest used friction |T| / N [-]

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


def carry(steering: Steering, phases: Sequence[Phase]) -> Carried:
    """
    Carry the object along a path, until its end or until the object is lost.

    :param steering: controller of the plant that holds the object.
    :param phases: phases of the path in order.
    """
    plant = steering.plant
    goal = np.array(plant.object_pose())
    rows: list[tuple[float, Pose, Array, float, float]] = []
    cycle, start = 1.0 / RATE, plant.time
    for phase in phases:
        for k in range(round(phase.duration * RATE)):
            now = plant.time - start
            middle = np.array(phase.twist((k + 0.5) * cycle))
            error = goal - np.array(plant.object_pose())
            plant.advance(cycle, steering.command(middle, error))
            goal = goal + cycle * middle
            forces = plant.contact_forces().values()
            squeeze = 0.5 * sum(force.normal for force in forces)
            used = max((abs(f.friction) / max(f.normal, 1e-9) for f in forces), default=math.inf)
            rows.append((now + cycle, plant.object_pose(), goal, squeeze, used))
            if np.hypot(*(goal - np.array(plant.object_pose()))[:2]) > LOST:
                return _stack(rows)
    return _stack(rows)


def _stack(rows: Sequence[tuple[float, Pose, Array, float, float]]) -> Carried:
    times, poses, goals, squeezes, frictions = zip(*rows, strict=True)
    return Carried(
        np.array(times), np.array(poses), np.array(goals), np.array(squeezes), np.array(frictions)
    )
