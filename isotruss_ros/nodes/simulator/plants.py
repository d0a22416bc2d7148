# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plants of the node `simulator`: a static one, and MuJoCo behind the same interface."""

from __future__ import annotations

from isotruss_ros.core import (
    ConvexObject,
    ElasticObject,
    Grip,
    HoldStatus,
    Pose,
    RigidObject,
    Robot,
    RollerFaults,
    RollingGrip,
    SimulatedRobot,
)
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.simulation.simulated_robot import SimulatedObject
from isotruss_ros.mujoco_plant.driven_robot import DrivenRobot
from isotruss_ros.mujoco_plant.options import PlantOptions
from isotruss_ros.nodes.framework import common_parameters as common
from isotruss_ros.nodes.framework.parameters import ParameterError, Parameters
import numpy as np
from numpy.typing import ArrayLike

KINEMATIC, ELASTIC, MUJOCO = 'kinematic', 'elastic', 'mujoco'
#: Largest roller speed; faster commands are reduced to it [m/s].
SPEED_LIMIT = 1.0
#: Longest time that MuJoCo simulates per cycle unless the node uses simulated time [s]; the rest
#: is reported as lag.
MAX_CYCLE_STEP = 0.1


class StaticPlant(SimulatedRobot):
    """
    Robot and object without dynamics; the object is rigid, or in equilibrium with elastic tubes.

    :ivar elastic: object between elastic tubes; None for a rigid object.
    :ivar lag: None; see `DrivenRobot`.
    """

    elastic: ElasticObject | None = None
    lag = None

    def __init__(
        self, robot: Robot, body: ConvexObject, values: Parameters, faults: RollerFaults
    ) -> None:
        self._values, self._body = values, body
        if values.plant == ELASTIC or values.object_is_free:
            simulated = self._put_object(body.pose)
        else:
            members = common.select_grip(robot, values)
            simulated = RigidObject.in_grip(RollingGrip.attach(robot.home, Grip(members, body)))
        super().__init__(robot.home, simulated, faults, values.seed)

    def _put_object(self, pose: Pose) -> SimulatedObject:
        """Return a free object at a pose; only friction can hold it."""
        values, body = self._values, self._body.moved_to(pose)
        if values.plant == KINEMATIC:
            return RigidObject(body, values.friction)
        friction = values.friction if body.friction is None else body.friction
        self.elastic = ElasticObject(body, friction)
        return self.elastic

    @property
    def dropped(self) -> HoldStatus | None:
        """Return the reason of the last loss of the object; None if it is held or never was."""
        return None if self.elastic is None else self.elastic.dropped

    @property
    def joints(self) -> Array:
        """Return the joint positions, (j, 2) [m]."""
        if self.elastic is not None:
            return self.elastic.joints(self.config)
        return self.config.nodes[: len(self.config.robot.topology.joint_names)]

    @property
    def normal_forces(self) -> dict[str, float]:
        """Return the normal force of each member on the object [N]; empty without contact."""
        grasp = None if self.elastic is None else self.elastic.grasp
        if grasp is None:
            return {}
        return dict(zip(grasp.member_names, grasp.normal_forces.tolist(), strict=True))

    def place_object(self, pose: Pose) -> None:
        """Move the object to another pose, where it is free; the robot does not move."""
        self.replace_object(self._put_object(pose))
        self.advance(0.0)

    def pull(self, wrench: ArrayLike) -> None:
        """
        Set the external wrench on the object; it does not move a rigid object.

        :param wrench: wrench (fx, fy, m) about the centre of the object [N, N m].
        """
        if self.elastic is not None:
            self.elastic.external_wrench = np.asarray(wrench)


Plant = StaticPlant | DrivenRobot


def make_plant(robot: Robot, body: ConvexObject, values: Parameters, in_real_time: bool) -> Plant:
    """
    Return the plant that the parameters of the node specify.

    :param in_real_time: whether MuJoCo skips the time for which the machine is too slow.
    :raises IsotrussError: a parameter is invalid.
    """
    stuck = frozenset({values.stuck_roller} - {''})
    faults = RollerFaults(SPEED_LIMIT, stuck=stuck, slip=values.roller_slip)
    if values.plant in (KINEMATIC, ELASTIC):
        return StaticPlant(robot, body, values, faults)
    if values.plant != MUJOCO:
        raise ParameterError(
            f'parameter plant: {values.plant!r}: must be {KINEMATIC}, {ELASTIC} or {MUJOCO}'
        )
    options = PlantOptions(friction=values.friction, ground_friction=values.ground_friction)
    longest = MAX_CYCLE_STEP if in_real_time else float('inf')
    free, seed = values.object_is_free, values.seed
    return DrivenRobot(robot, body, free, options, faults, seed, longest)
