# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Simulated robot with rollers that follow commands, faults of the rollers, and an object."""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Protocol

from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.model.setting_ranges import check_settings
from isotruss_ros.core.model.topology import check_names
from isotruss_ros.core.numerics.argument_kinds import check_kinds
from isotruss_ros.core.numerics.arrays import Array, check_count
import numpy as np
from numpy.typing import ArrayLike

#: Unit, smallest and largest value of each number; a roller without limit has an infinite one.
FAULT_RANGES = {
    'speed_limit': ('m/s', 0.0, math.inf),
    'noise': ('m/s', 0.0, 1.0),
    'slip': ('', 0.0, 0.5),
}


@dataclass(frozen=True)
class RollerFaults:
    """
    Faults of the rollers.

    With slip, the tube moves less than the surface of the roller by a fraction of the travel, in
    both directions. The encoders are on the rollers and do not measure slip, so the true
    configuration drifts away from the measured configuration. The fraction of each roller is drawn
    once, uniformly between 0.5 and 1.5 times `slip`.

    :ivar speed_limit: largest roller speed; commands beyond it are clipped [m/s].
    :ivar noise: standard deviation of the speed of a moving roller, drawn in each step [m/s].
    :ivar stuck: names of stuck rollers.
    :ivar slip: mean slip as a fraction of the travel, 0 to 0.5 [-].
    """

    speed_limit: float = math.inf
    noise: float = 0.0
    stuck: frozenset[str] = frozenset()
    slip: float = 0.0

    def __post_init__(self) -> None:
        """Raise ConfigurationError if a number is out of its range."""
        check_settings(self, FAULT_RANGES, ConfigurationError)


class DrivenRollers:
    """
    Rollers that follow commands, with faults; a subclass integrates their travel.

    :ivar roller_positions: (r,) travel measured by the encoders [m].
    :ivar roller_velocities: (r,) mean speeds in the last step, measured by the encoders [m/s].
    """

    def __init__(self, robot: Mechanism, faults: RollerFaults, seed: int = 0) -> None:
        names = robot.roller_names
        check_names('stuck rollers', faults.stuck, names, robot.name)
        self._robot, self._faults = robot, faults
        self._is_free = np.array([name not in faults.stuck for name in names])
        seed = check_count(seed, 'seed', ConfigurationError)
        self._random = np.random.default_rng(seed)
        # Separate random stream: the noise of a seed is independent of slip.
        slips = faults.slip * np.random.default_rng([seed, 1]).uniform(0.5, 1.5, len(names))
        self._travel_ratios = 1.0 - slips  # of the tubes' travel to the rollers' travel [-]
        self._command, self.roller_positions, self.roller_velocities = np.zeros((3, len(names)))

    def command(self, velocities: ArrayLike) -> None:
        """Set the roller speeds (r,), which are valid until the next command [m/s]."""
        self._command = self._robot.check_rollers(velocities, 'roller velocities [m/s]')

    def stop(self) -> None:
        """Command zero speed to all rollers."""
        self._command = np.zeros_like(self._command)

    def _speeds(self) -> Array:
        """Return the roller speeds (r,) in the next step, exactly zero at rest [m/s]."""
        limit = self._faults.speed_limit
        speeds = np.where(self._is_free, np.clip(self._command, -limit, limit), 0.0)
        if self._faults.noise > 0.0:
            noise = self._random.normal(0.0, self._faults.noise, len(speeds))
            speeds = speeds + (speeds != 0.0) * noise
        return speeds


class SimulatedObject(Protocol):
    """Protocol of an object in a simulated robot."""

    def pose(self, config: Configuration) -> Pose:
        """
        Return the object's pose in a configuration of the robot.

        :param config: configuration of the robot.
        """

    def follow(self, config: Configuration) -> None:
        """
        Move the object with the robot to a new configuration; called in every step.

        :param config: configuration of the robot; the same one as in the last step if the rollers
            have not moved.
        """


class SimulatedRobot(DrivenRollers):
    """
    Simulated robot that integrates roller speeds; forward kinematics moves nodes and object.

    :ivar config: true configuration; without slip it is the configuration at `roller_positions`.
    :param simulated: the object, which is a `RigidObject`, an `ElasticObject` or user-defined.
    :param faults: faults of the rollers.
    :param seed: seed of the random numbers for noise and slip.
    :raises GraspError: a roller named as stuck does not exist.
    :raises ConfigurationError: the slip is out of its range, or the seed is invalid.
    """

    @check_kinds
    def __init__(
        self,
        config: Configuration,
        simulated: SimulatedObject,
        faults: RollerFaults,
        seed: int = 0,
    ) -> None:
        super().__init__(config.robot, faults, seed)
        self.config = config
        self.roller_positions = config.roller_positions.copy()
        self._object = simulated

    @property
    def object_pose(self) -> Pose:
        """Return the object's pose in the robot frame."""
        return self._object.pose(self.config)

    def replace_object(self, simulated: SimulatedObject) -> None:
        """
        Replace the robot's object without moving the robot.

        :param simulated: the object, which is a `RigidObject`, an `ElasticObject` or user-defined.
        """
        self._object = simulated

    def drive(self, duration: float) -> None:
        """
        Move rollers and nodes for a time interval; the object follows in the next `advance`.

        :param duration: length of the interval, not negative [s].
        :raises ConfigurationError: no configuration exists at the new travel, so the rollers
            block.
        """
        speeds = self._speeds()
        if duration > 0.0:
            self.roller_velocities = np.zeros_like(speeds)
            if speeds.any():
                travel = duration * speeds
                goal = self.config.roller_positions + self._travel_ratios * travel
                self.config = self.config.moved_to(goal)
                self.roller_positions = self.roller_positions + travel
                self.roller_velocities = speeds

    def advance(self, duration: float) -> None:
        """
        Move rollers, nodes and object for a time interval.

        :param duration: length of the interval, not negative [s].
        :raises ConfigurationError: no configuration exists at the new travel, so the rollers
            block.
        """
        self.drive(duration)
        self._object.follow(self.config)
