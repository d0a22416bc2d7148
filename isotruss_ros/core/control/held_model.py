# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The model of a held object in the loop: what it takes from a grasp at a module or any grip."""

from __future__ import annotations

from dataclasses import dataclass
import functools

from isotruss_ros.core.grasping.held_grip import HeldGrip
from isotruss_ros.core.grasping.held_members import Hold
from isotruss_ros.core.grasping.rolling_grasp import RollingGrasp
from isotruss_ros.core.grasping.slip_margin import slip_margin
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grasp import Grasp, members_at_module
from isotruss_ros.core.manipulation.grip import find_members, Grip
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.manipulation.task import task_jacobian
from isotruss_ros.core.model.convex_object import as_convex_object
from isotruss_ros.core.model.objects import Cylinder, Pose
from isotruss_ros.core.numerics.arrays import Array

#: How an object is held: by the two members of a module, or by any.
HeldModel = RollingGrasp | HeldGrip


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """
    How a held object answers to a small wrench (fx, fy, m / arm) [N], and to the grip's opening.

    :ivar pose: (3, 3) displacement of (x, y, angle) [m/N, rad/N].
    :ivar squeeze: (3,) change of the mean normal force of the members [-].
    :ivar slope: change of the squeeze as the grip opens, negative [N/rad]; of any grip [N/m].
    :ivar slip_margin: see `SettledGrasp.slip_margin` [N].
    """

    pose: Array
    squeeze: Array
    slope: float
    slip_margin: float


def attach_model(config: Configuration, held: Grasp | Grip, angle: float) -> HeldModel | Hold:
    """
    Return the equilibrium near the measured pose, or why there is none.

    :param config: where the robot is.
    :param held: the grasp; its object is where it was measured.
    :param angle: of a cylinder, measured [rad]; a convex object has its own.
    :raises GraspError: no such members.
    :raises StructureError: see `structure_of`.
    """
    if isinstance(held, Grasp):
        return RollingGrasp.attach(config, Cylinder(held.center, held.diameter), angle)
    body = as_convex_object(held.body)
    if body is not held.body:
        body = body.moved_to((*body.pose[:2], angle))
    return HeldGrip.attach(config, body, find_members(config.robot, held.members).members)


def measured_pose(held: Grasp | Grip, angle: float) -> Pose:
    """
    Return where an object was measured.

    :param held: the grasp.
    :param angle: of a cylinder, measured [rad]; a convex object has its own.
    """
    if isinstance(held, Grasp):
        return Pose(*held.center, angle)
    body = held.body
    return Pose(*body.center, angle) if isinstance(body, Cylinder) else body.pose


def motion_of(config: Configuration, held: Grasp | Grip, travel: Array) -> tuple[Array, float]:
    """
    Return how a held object moves, and the grip opens, with the rollers, by the rows of (19).

    :param config: where the robot is.
    :param held: the grasp.
    :param travel: (r,) of the rollers [m].
    :return: (3,) [m, rad], and the opening [rad]; of any grip [m].
    :raises GraspError: see `grasp_rows` and `find_contacts`.
    :raises ConfigurationError: the configuration is singular.
    """
    if isinstance(held, Grip):
        rows = grip_jacobian(config, held) @ travel
        return rows[:3], float(rows[3])
    rows = task_jacobian(config, held) @ travel
    return rows[:3], float(members_at_module(config, held.module).side * rows[3])


@functools.lru_cache(maxsize=2)  # several cycles ask for the same equilibrium
def sensitivity(grasp: HeldModel, friction: float) -> Sensitivity | None:
    """
    Return how a held object answers; None where its equilibrium is indifferent.

    :param grasp: how the object is held.
    :param friction: coefficient between tube and object.
    """
    response = grasp.response
    if response is None:
        return None
    margin = slip_margin(grasp.state, response, friction)
    return Sensitivity(response.pose, response.squeeze, grasp.squeeze_by_opening(), margin)
