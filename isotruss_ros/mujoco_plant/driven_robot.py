# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Robot and object in MuJoCo, with the interface of `core.SimulatedRobot`."""

from __future__ import annotations

from collections.abc import Sequence

from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.obstacle import Obstacle
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.simulation.simulated_robot import DrivenRollers, RollerFaults
from isotruss_ros.mujoco_plant.options import PlantOptions
from isotruss_ros.mujoco_plant.plant import MujocoPlant
import numpy as np
from numpy.typing import ArrayLike

#: Simulated time in which the tubes come to rest on an object that is grasped at the start [s].
SETTLING_TIME = 1.0


class DrivenRobot(DrivenRollers):
    """
    Robot and object in MuJoCo, driven by rollers with encoders.

    :ivar plant: the robot in MuJoCo.
    :ivar dropped: None, because MuJoCo reports no reason why an object is lost.
    :ivar lag: total time that was skipped because `advance` was called with more than
        `longest_step` [s].
    :param robot: the robot, initially at home.
    :param body: the object at its pose.
    :param is_free: whether the object is free from the start; if not, it is fixed until the tubes
        have come to rest on its surface.
    :param options: masses, friction, gravity and mesh.
    :param faults: simulated faults of the rollers.
    :param seed: random seed of roller noise and slip.
    :param longest_step: longest simulated time in one call of `advance` [s].
    :param obstacles: obstacles, see `MujocoPlant`.
    :raises PlantError: MuJoCo is not installed, or the start is unstable.
    :raises GraspError: a roller that `faults` names as stuck does not exist.
    :raises ConfigurationError: the slip of the rollers is out of its range.
    :raises StructureError: the stiffness model is invalid for the length of a member.
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
        obstacles: Sequence[Obstacle] = (),
    ) -> None:
        super().__init__(robot, faults, seed)
        self.dropped = None
        self.plant = MujocoPlant(robot, body, options, obstacles=obstacles)
        self._config = robot.home
        self.lag = 0.0
        self._longest_step = longest_step
        if not is_free:
            self.plant.hold_object(body.pose)
            self.plant.settle(SETTLING_TIME)
            self.plant.release_object()

    @property
    def object_pose(self) -> Pose:
        """Return the object's pose in the robot frame."""
        return self.plant.object_pose()

    @property
    def joints(self) -> Array:
        """Return the positions of the robot's joints, (j, 2) [m]."""
        return self.plant.nodes[: len(self._config.robot.topology.joint_names)]

    @property
    def normal_forces(self) -> dict[str, float]:
        """Return the normal force of each member on the object [N]."""
        return {name: force.normal for name, force in self.plant.contact_forces().items()}

    def pull(self, wrench: ArrayLike) -> None:
        """
        Set the external wrench on the object from now on.

        :param wrench: wrench (fx, fy, m) about the origin of the object's frame [N, N m].
        :raises PlantError: the wrench is not finite.
        """
        self.plant.pull(wrench)

    def place_object(self, pose: Pose) -> None:
        """
        Move the object to another pose, free and at rest; the robot does not move.

        :param pose: pose (x, y, angle) in the robot frame [m, rad].
        :raises PlantError: the pose is not finite.
        """
        self.plant.hold_object(pose)
        self.plant.release_object()

    def advance(self, duration: float) -> None:
        """
        Simulate a time interval with the commanded roller speeds.

        :param duration: length of the interval, not negative [s].
        :raises ConfigurationError: no configuration exists at the commanded roller travel, so the
            rollers block.
        :raises PlantError: the simulation became unstable.
        """
        simulated = min(duration, self._longest_step)
        self.lag += duration - simulated
        speeds = self._speeds()
        blocked: ConfigurationError | None = None
        try:
            # Rollers without a force limit would tear the robot apart.
            travel = self.plant.travel + simulated * self._travel_ratios * speeds
            self._config = self._config.moved_to(travel)
        except ConfigurationError as error:
            blocked, speeds = error, np.zeros_like(speeds)
        self.plant.advance(simulated, self._travel_ratios * speeds)
        # Travel of the plant, which advances by whole steps, so that the encoders agree with it.
        self.roller_positions = self.plant.travel / self._travel_ratios
        self.roller_velocities = self.plant.speeds / self._travel_ratios
        if blocked is not None:
            raise blocked

    #: The physics moves rollers and object together.
    drive = advance
