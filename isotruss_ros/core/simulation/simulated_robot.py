# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A simulated robot: rollers that follow commands, well or badly, and an object in the grip."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.model.topology import check_roller_names
from isotruss_ros.core.numerics.arrays import Array
import numpy as np
from numpy.typing import ArrayLike

#: A roller that loses more than this of its travel is not slipping but broken.
MAX_SLIP = 0.5


@dataclass(frozen=True)
class RollerFaults:
    """
    How the rollers differ from perfect ones.

    Slip is that of a friction drive: the tube follows the roller's surface less a share of the
    travel, in both directions. The encoders turn with the rollers and do not measure it, so that
    the configuration drifts away from the measured one. No two rollers pinch alike: each has a
    share of its own, drawn once, even between half and one and a half times `slip`.

    :ivar speed_limit: larger commands are cut to this [m/s].
    :ivar noise: standard deviation of the speed of a moving roller, drawn again each step [m/s].
    :ivar stuck: names of rollers that do not move.
    :ivar slip: mean share of the travel that the tube does not follow, 0 to 0.5.
    """

    speed_limit: float = float('inf')
    noise: float = 0.0
    stuck: frozenset[str] = frozenset()
    slip: float = 0.0


class DrivenRollers:
    """
    Rollers that follow commands, with their faults; where they go is of a robot that has them.

    :ivar roller_positions: (r,) travel as the encoders tell it [m].
    :ivar roller_velocities: (r,) speeds during the last step as the encoders tell them [m/s].
    :param robot: whose rollers they are.
    :param faults: how the rollers differ from perfect ones.
    :param seed: of the noise and the slip.
    :raises GraspError: a stuck roller that the robot does not have.
    :raises ConfigurationError: a slip out of its range.
    """

    def __init__(self, robot: Mechanism, faults: RollerFaults, seed: int = 0) -> None:
        names = robot.roller_names
        check_roller_names('stuck rollers', faults.stuck, names)
        if not 0.0 <= faults.slip <= MAX_SLIP:
            raise ConfigurationError(f'slip {faults.slip!r}: must be from 0 to {MAX_SLIP}')
        self._robot, self._faults = robot, faults
        self._free = np.array([name not in faults.stuck for name in names])
        self._random = np.random.default_rng(seed)
        # From a stream of its own: with or without slip, the noise of a seed is the same.
        shares = np.random.default_rng([seed, 1]).uniform(0.5, 1.5, len(names))
        # What share of each roller's travel its tube follows [-].
        self._grips = 1.0 - faults.slip * shares
        self._command, self.roller_positions, self.roller_velocities = np.zeros((3, len(names)))

    def command(self, velocities: ArrayLike) -> None:
        """
        Take a command, which holds until the next.

        :param velocities: (r,) roller speeds [m/s].
        :raises ConfigurationError: wrong shape or not finite; the command before goes on.
        """
        self._command = self._robot.check_rollers(velocities, 'roller velocities [m/s]')

    def stop(self) -> None:
        """Command all rollers to stand still."""
        self._command = np.zeros_like(self._command)

    def _speeds(self) -> Array:
        """Return the (r,) speeds of the rollers in the next step, zero where one rests [m/s]."""
        limit = self._faults.speed_limit
        speeds = np.clip(self._command, -limit, limit)
        moving = self._free & (speeds != 0.0)
        speeds = np.where(moving, speeds, 0.0)
        if self._faults.noise > 0.0:
            speeds = speeds + moving * self._random.normal(0.0, self._faults.noise, len(speeds))
        return speeds


class SimulatedObject(Protocol):
    """An object in a simulated robot: all that a plant says of it."""

    def pose(self, config: Configuration) -> Pose:
        """
        Return its pose in a configuration.

        :param config: configuration of the robot.
        """

    def follow(self, config: Configuration) -> None:
        """
        Go with the robot to a configuration, in every step.

        :param config: configuration of the robot.
        """

    def come_to_rest(self, config: Configuration) -> None:
        """
        Take note that the rollers have come to rest.

        :param config: configuration of the robot.
        """


class SimulatedRobot(DrivenRollers):
    """
    Integrates roller speeds; nodes and object follow by forward kinematics, so nothing drifts.

    :ivar config: where the robot is: without slip `roller_positions` are those of it.
    :param simulated: the object: `RigidObject`, `ElasticObject` or one's own.
    :param faults: how the rollers differ from perfect ones.
    :param seed: of the noise.
    :raises GraspError: a stuck roller that the robot does not have.
    :raises ConfigurationError: a slip out of its range.
    """

    def __init__(
        self,
        config: Configuration,
        simulated: SimulatedObject,
        faults: RollerFaults,
        seed: int = 0,
    ) -> None:
        super().__init__(config.robot, faults, seed)
        self.config = self._factored = config
        self.roller_positions = config.roller_positions.copy()
        self._object = simulated
        self._rests = False

    @property
    def object_pose(self) -> Pose:
        """Return the object's pose in the robot frame."""
        return self._object.pose(self.config)

    def replace_object(self, simulated: SimulatedObject) -> None:
        """
        Put another object in place of the present one; the robot stays as it is.

        :param simulated: the object: `RigidObject`, `ElasticObject` or one's own.
        """
        self._object, self._rests = simulated, False

    def advance(self, duration: float) -> None:
        """
        Let time pass.

        :param duration: not negative [s].
        :raises ConfigurationError: the rollers would force the robot into a shape that it cannot
            take; they block, and it stays where it is.
        """
        speeds = self._speeds()
        moving = bool(speeds.any())
        self.roller_velocities = np.zeros_like(speeds)
        if duration > 0.0 and moving:
            travel = duration * speeds
            goal = self.config.roller_positions + self._grips * travel
            if not self._factored.has_factor_for(goal):
                self._factored = self.config
            self.config = self.config.moved_to(goal, self._factored.factor)
            self.roller_positions = self.roller_positions + travel
            self.roller_velocities = speeds
        self._object.follow(self.config)
        if not moving and not self._rests:
            self._object.come_to_rest(self.config)
        self._rests = not moving
