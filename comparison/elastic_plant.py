# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The elastic plant, to be commanded like that of MuJoCo."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace

from isotruss_ros.core import (
    ConvexObject,
    ElasticObject,
    Pose,
    Robot,
    RollerFaults,
    SimulatedRobot,
)
from isotruss_ros.core.numerics.arrays import Array
from numpy.typing import ArrayLike


class ElasticPlant:
    """
    The elastic plant with an object in the grip, in equilibrium.

    :ivar time: since the start [s].
    :ivar object: that it holds.
    :param robot: at home, with masses.
    :param body: in the grip, with its mass.
    :param friction: coefficient between tube and object.
    :param module_friction: of the floor under each joint [N].
    """

    def __init__(
        self, robot: Robot, body: ConvexObject, friction: float, module_friction: float = 0.0
    ) -> None:
        self.time = 0.0
        self.object = ElasticObject(body, friction, module_friction=module_friction)
        self._robot = SimulatedRobot(robot.home, self.object, RollerFaults())
        self._robot.advance(0.0)

    @property
    def travel(self) -> Array:
        """Return that of the rollers, (r,) [m]."""
        return self._robot.roller_positions

    @property
    def speeds(self) -> Array:
        """Return those of the rollers, (r,) [m/s]."""
        return self._robot.roller_velocities

    def object_pose(self) -> Pose:
        """Return where the object is."""
        return self._robot.object_pose

    def contact_forces(self) -> Mapping[str, SimpleNamespace]:
        """Return the normal forces of members on the object, by member [N]."""
        grasp = self.object.grasp
        if grasp is None:
            return {}
        forces = zip(grasp.member_names, grasp.normal_forces.tolist(), strict=True)
        return {name: SimpleNamespace(normal=force) for name, force in forces}

    def pull(self, wrench: ArrayLike) -> None:
        """
        Pull at the object until further notice.

        :param wrench: (fx, fy, m) [N, N m].
        """
        self.object.external_wrench = wrench

    def advance(self, duration: float, speeds: ArrayLike) -> None:
        """
        Let the rollers turn.

        :param duration: for so long [s].
        :param speeds: (r,) [m/s].
        """
        self._robot.command(speeds)
        self._robot.advance(duration)
        self.time += duration
