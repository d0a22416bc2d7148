# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The object of the node `simulator`: which one, where it begins, and what holds it there."""

from __future__ import annotations

from dataclasses import replace

from isotruss_ros.core import (
    ConvexObject,
    Disc,
    ElasticObject,
    Grip,
    place_between,
    Pose,
    RigidObject,
    Robot,
    RollingGrip,
    tangent_center,
)
from isotruss_ros.core.simulation.simulated_robot import SimulatedObject
from isotruss_ros.nodes.components import common_parameters as common
from isotruss_ros.nodes.framework.parameters import Parameters, Spec

# The simulated object is grasped from the start and stays so, or it is free at first.
GRIP_MODULE = replace(common.GRIP_MODULE, read_only=True)
GRIP = replace(common.GRIP, read_only=True)
OBJECT_DIAMETER = replace(common.OBJECT_DIAMETER, read_only=True)
FRICTION = replace(common.FRICTION, read_only=True)
INDENTATION = Spec(
    'indentation',
    0.0,
    'How far the tubes are indented by the object at home, 0 where they just touch [m]',
    bounds=(0.0, 0.1),
    read_only=True,
)
OBJECT_IS_FREE = Spec(
    'object_is_free',
    False,
    'The object is free at object_x, object_y until friction closes a grasp; grasped if false',
    read_only=True,
)
OBJECT_X = Spec(
    'object_x', 0.6, 'Position of the free object [m]', bounds=(-1e3, 1e3), read_only=True
)
OBJECT_Y = Spec(
    'object_y', 0.3, 'Position of the free object [m]', bounds=(-1e3, 1e3), read_only=True
)
OBJECT_ANGLE = Spec(
    'object_angle',
    0.0,
    'Orientation of the object at the start, free or grasped [rad]',
    bounds=(-6.3, 6.3),
    read_only=True,
)
SPECS = (
    OBJECT_DIAMETER,
    common.OBJECT,
    GRIP_MODULE,
    GRIP,
    INDENTATION,
    OBJECT_IS_FREE,
    OBJECT_X,
    OBJECT_Y,
    OBJECT_ANGLE,
    FRICTION,
)


class StartingObject:
    """
    The object where it begins, for all plants.

    :ivar robot: at home.
    :ivar body: in its place in the robot frame.
    :ivar is_free: nothing holds it at the start.
    :param robot: at home.
    :param values: of the parameters `SPECS`.
    :raises IsotrussError: a parameter is unusable, or the object does not fit there.
    """

    def __init__(self, robot: Robot, values: Parameters) -> None:
        module = values.grip_module
        common.check_grip(robot, {GRIP_MODULE.name: module, GRIP.name: values.grip})
        self.robot, self.is_free = robot, values.object_is_free
        self._friction, diameter = values.friction, values.object_diameter
        self._members = common.select_grip(robot, values.grip, module)
        place = (values.object_x, values.object_y)
        angle, indentation = values.object_angle, values.indentation
        described = common.read_described(values)
        body = described or ConvexObject(Disc(diameter), friction=self._friction)
        pose = Pose(*place, angle)
        if not self.is_free and (described or common.named_members(values.grip)):
            pose = place_between(
                robot.home, self._members, body.shape, angle, indentation
            ).body.pose
        elif not self.is_free:
            center = tangent_center(
                robot.home, common.select_grip_module(robot, module), diameter, indentation
            )
            pose = Pose(*center, angle)
        self.body = body.moved_to(pose)

    @property
    def pose(self) -> Pose:
        """Return its pose at the start."""
        return self.body.pose

    def held(self) -> SimulatedObject:
        """Return it as the kinematic plant has it in the grip."""
        home, body = self.robot.home, self.body
        return RigidObject.in_grip(RollingGrip.attach(home, Grip(self._members, body)))

    def lying(self, pose: Pose) -> SimulatedObject:
        """
        Return it as the kinematic plant has it on the ground.

        :param pose: where it is put.
        """
        return RigidObject(self.body.moved_to(pose), self._friction)

    def elastic(
        self, pose: Pose, stiffness_scale: float, ground_friction: float, module_friction: float
    ) -> ElasticObject:
        """
        Return it as the elastic plant has it.

        :param pose: where it is put.
        :param stiffness_scale: stiffness of the plant against that of the model.
        :param ground_friction: up to which the floor holds it in its place [N].
        :param module_friction: up to which it holds each joint [N].
        """
        body = self.body
        friction = self._friction if body.friction is None else body.friction
        floor = ground_friction, module_friction
        return ElasticObject(body.moved_to(pose), friction, stiffness_scale, *floor)
