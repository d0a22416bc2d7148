# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Object of the node `simulator`, and its two kinds of plants: static, and MuJoCo."""

from __future__ import annotations

from dataclasses import replace

from isotruss_ros.core import (
    ConvexObject,
    ElasticObject,
    Grip,
    HoldStatus,
    place_between,
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
from isotruss_ros.nodes.framework.parameters import FixedSpec, ParameterError, Parameters
import numpy as np
from numpy.typing import ArrayLike

# The simulated object is grasped permanently, or free at the start.
KINEMATIC, ELASTIC, MUJOCO = 'kinematic', 'elastic', 'mujoco'
#: Largest roller speed; faster commands are reduced to it [m/s].
SPEED_LIMIT = 1.0
#: Longest time that MuJoCo simulates per cycle unless the node uses simulated time [s]; the rest
#: is reported as lag.
MAX_CYCLE_STEP = 0.1
SPECS = (
    replace(common.OBJECT_DIAMETER, read_only=True),
    common.OBJECT,
    common.OBSTACLES,
    replace(common.GRIP_MODULE, read_only=True),
    replace(common.GRIP, read_only=True),
    FixedSpec(
        'indentation',
        0.0,
        'Initial penetration of the object into the skin of each grasping member [m]; 0: contact '
        'without force',
        (0.0, 0.1),
    ),
    FixedSpec(
        'object_is_free',
        False,
        'Whether the object is free at object_pose at the start; if false, it is held',
    ),
    FixedSpec(
        'object_pose',
        [0.6, 0.3, 0.0],
        'Initial pose (x, y, angle) of a free object [m, rad]; of a held object only the angle is '
        'used',
    ),
    replace(common.FRICTION, read_only=True),
    FixedSpec(
        'ground_friction',
        0.0,
        'Friction force of the ground on the object along x or y, only in the plant mujoco [N]',
        (0.0, 1e3),
    ),
)


def place_at_start(robot: Robot, values: Parameters) -> ConvexObject:
    """Return the object at its initial pose in the robot frame, for every kind of plant."""
    if len(values.object_pose) != 3:
        raise ParameterError(
            f'parameter object_pose: {list(values.object_pose)}: must be three numbers x, y, angle'
        )
    place, indentation = Pose(*values.object_pose), values.indentation
    body = common.make_body(values, common.read_described(values))
    if not values.object_is_free:
        members = common.select_grip(robot, values)
        place = place_between(robot.home, members, body.shape, place.angle, indentation).body.pose
    return body.moved_to(place)


class StaticPlant(SimulatedRobot):
    """
    Robot and object without dynamics; the object is in equilibrium on elastic tubes, or rigid.

    A rigid object is held from the start: only friction between elastic tubes can hold a free one.

    :ivar elastic: object that elastic tubes can hold; None for a rigid object.
    :ivar lag: None, because this plant never lags behind the clock.
    """

    elastic: ElasticObject | None = None
    lag = None

    def __init__(
        self, robot: Robot, body: ConvexObject, values: Parameters, faults: RollerFaults
    ) -> None:
        self._values, self._body = values, body
        simulated: SimulatedObject
        if values.plant == ELASTIC or values.object_is_free:
            simulated = self._put_object(body.pose)
        else:
            members = common.select_grip(robot, values)
            simulated = RigidObject(RollingGrip.attach(robot.home, Grip(members, body)))
        super().__init__(robot.home, simulated, faults, values.seed)

    def _put_object(self, pose: Pose) -> ElasticObject:
        """Return a free object at a pose, which only friction can hold."""
        self.elastic = ElasticObject(self._body.moved_to(pose), self._body.friction_or(None))
        return self.elastic

    @property
    def dropped(self) -> HoldStatus | None:
        """Return the reason why the object was last lost; None if it is held or never was held."""
        return None if self.elastic is None else self.elastic.dropped

    @property
    def joints(self) -> Array:
        """Return the positions of the robot's joints, (j, 2) [m]."""
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
        """Move the object to another pose, at which it is free; the robot does not move."""
        self.replace_object(self._put_object(pose))
        self.advance(0.0)

    def pull(self, wrench: ArrayLike) -> None:
        """
        Set the external wrench on the object; it has no effect on a rigid object.

        :param wrench: wrench (fx, fy, m) about the origin of the object's frame [N, N m].
        """
        if self.elastic is not None:
            self.elastic.external_wrench = np.asarray(wrench)


Plant = StaticPlant | DrivenRobot


def make_plant(robot: Robot, body: ConvexObject, values: Parameters, in_real_time: bool) -> Plant:
    """Return the plant that the parameters of the node specify."""
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
    obstacles = common.read_resting_obstacles(values)
    return DrivenRobot(robot, body, free, options, faults, seed, longest, obstacles)
