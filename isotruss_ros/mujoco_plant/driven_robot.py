# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A robot in MuJoCo that follows roller commands, as `core.SimulatedRobot` does."""

from __future__ import annotations

from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.simulation.simulated_robot import DrivenRollers, RollerFaults
from isotruss_ros.mujoco_plant.options import PlantOptions
from isotruss_ros.mujoco_plant.plant import MujocoPlant
import numpy as np

#: Simulated for the tubes to bend around an object that is grasped at the start [s].
SETTLING = 1.0


class DrivenRobot(DrivenRollers):
    """
    MuJoCo moves robot and object; encoders measure the rollers.

    :ivar plant: the robot in MuJoCo.
    :ivar lag: time that was not simulated, because more than `longest_step` was due at once [s].
    :param robot: starts at home.
    :param body: the object in its place.
    :param is_free: the object is free from the start; if false, the tubes bend around it first.
    :param options: masses, friction, gravity and mesh.
    :param faults: how the rollers differ from perfect ones.
    :param seed: of the noise and the slip.
    :param longest_step: a call of `advance` simulates no more than this [s].
    :raises PlantError: MuJoCo is not installed, or the start is unstable.
    :raises GraspError: a stuck roller that the robot does not have.
    :raises ConfigurationError: a slip out of its range.
    :raises StructureError: the stiffness model has no stiffness for a member.
    """

    def __init__(
        self,
        robot: Robot,
        body: ConvexObject,
        is_free: bool,
        options: PlantOptions,
        faults: RollerFaults,
        seed: int = 0,
        longest_step: float = float('inf'),
    ) -> None:
        super().__init__(robot, faults, seed)
        self.plant = MujocoPlant(robot, [body], options)
        self._config = robot.home
        self.lag = 0.0
        self._longest_step = longest_step
        if not is_free:
            self.plant.hold_object(body.pose)
            self.plant.settle(SETTLING)
            self.plant.release_object()

    @property
    def object_pose(self) -> Pose:
        """Return the object's pose in the robot frame."""
        return self.plant.object_pose()

    def place_object(self, pose: Pose) -> None:
        """
        Put the object elsewhere, free and at rest; the robot stays as it is.

        :param pose: (x, y, angle) in the robot frame [m, rad].
        :raises PlantError: not finite.
        """
        self.plant.hold_object(pose)
        self.plant.release_object()

    def advance(self, duration: float) -> None:
        """
        Let time pass.

        :param duration: not negative [s].
        :raises ConfigurationError: the rollers would force the robot into a shape that it cannot
            take, by forward kinematics; they block.
        :raises PlantError: the simulation became unstable.
        """
        simulated = min(duration, self._longest_step)
        self.lag += duration - simulated
        speeds = self._speeds()
        blocked: ConfigurationError | None = None
        try:
            # Rollers have no force limit here: MuJoCo would tear the robot apart.
            travel = self.plant.travel + simulated * self._grips * speeds
            self._config = self._config.moved_to(travel)
        except ConfigurationError as error:
            blocked, speeds = error, np.zeros_like(speeds)
        self.plant.advance(simulated, self._grips * speeds)
        # From the plant, which advances by whole steps: so the encoders agree with it.
        self.roller_positions = self.plant.travel / self._grips
        self.roller_velocities = self.plant.speeds / self._grips
        if blocked is not None:
            raise blocked
