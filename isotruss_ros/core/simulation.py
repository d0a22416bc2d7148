"""A simulated robot: rollers that follow commands, well or badly, and an object in the grip."""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.motion import HeldObject, Pose
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RollerFaults:
    """
    How the rollers differ from perfect ones.

    :ivar speed_limit: larger commands are cut to this [m/s].
    :ivar noise: standard deviation of the speed of a moving roller, drawn anew each step [m/s].
    :ivar stuck: names of rollers that do not move.
    """

    speed_limit: float = float('inf')
    noise: float = 0.0
    stuck: frozenset[str] = frozenset()


class SimulatedRobot:
    """
    Integrates roller speeds; nodes and object follow by forward kinematics, so nothing drifts.

    :ivar config: where the robot is.
    :ivar roller_velocities: (r,) speeds during the last step [m/s].
    :param config: where it starts.
    :param held: the object in its grip.
    :param faults: how the rollers differ from perfect ones.
    :param seed: of the noise.
    :raises ConfigurationError: a stuck roller that the robot does not have.
    """

    def __init__(
        self, config: Configuration, held: HeldObject, faults: RollerFaults, seed: int = 0
    ) -> None:
        robot = config.robot
        unknown = faults.stuck - set(robot.roller_names)
        if unknown:
            raise ConfigurationError(
                f'stuck rollers {", ".join(sorted(map(repr, unknown)))}: robot {robot.name} has '
                f'no such rollers; its rollers are {", ".join(robot.roller_names)}'
            )
        self.config = config
        self.roller_velocities = np.zeros(len(robot.roller_names))
        self._held = held
        self._faults = faults
        self._moves = np.array([name not in faults.stuck for name in robot.roller_names])
        self._random = np.random.default_rng(seed)
        self._command = np.zeros(len(robot.roller_names))

    @property
    def object_pose(self) -> Pose:
        """Return the object's pose in the robot frame."""
        return self._held.pose(self.config)

    def command(self, velocities: ArrayLike) -> None:
        """
        Take a command, which holds until the next.

        :param velocities: (r,) roller speeds [m/s].
        :raises ConfigurationError: wrong shape or not finite; the command before goes on.
        """
        self._command = self.config.robot.check_rollers(velocities, 'roller velocities [m/s]')

    def stop(self) -> None:
        """Command all rollers to stand still."""
        self._command = np.zeros_like(self._command)

    def advance(self, duration: float) -> None:
        """
        Let time pass.

        :param duration: not negative [s].
        :raises ConfigurationError: the rollers would force the robot into a shape that it cannot
            take; they block, and it stays where it is.
        """
        limit = self._faults.speed_limit
        speeds = np.clip(self._command, -limit, limit)
        moving = self._moves & (speeds != 0.0)
        speeds = np.where(moving, speeds, 0.0)
        if self._faults.noise > 0.0:
            speeds = speeds + moving * self._random.normal(0.0, self._faults.noise, len(speeds))
        self.roller_velocities = np.zeros_like(speeds)
        if duration > 0.0 and moving.any():
            self.config = self.config.moved_to(self.config.roller_positions + duration * speeds)
            self.roller_velocities = speeds
