# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Plants in MuJoCo that hold an object in a wedge of the nine-member robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
import functools

from comparison.wedge import closed_to, MODULE
from isotruss_ros.core import (
    Configuration,
    ConvexObject,
    load_robot,
    tangent_center,
)
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.grip import find_members, members_at
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.mujoco_plant.options import PlantOptions, ROUND
from isotruss_ros.mujoco_plant.plant import MujocoPlant
import numpy as np

#: Where an object waits that would be in the way of the closing wedge: x, y [m], angle [rad].
AWAY = (5.0, 5.0, 0.0)
#: Where only the state at rest counts: drag so large that oscillations of soft modes end soon.
STILL = PlantOptions(joint_drag=25.0)
#: Rest after a motion of the rollers [s].
REST = 1.0


@dataclass(frozen=True)
class PressedCase:
    """What presses on an object."""

    degrees: float  #: angle of the wedge at `MODULE`
    indentation: float  #: of each member by the object, tubes unbent [m]
    diameter: float = 0.3  #: of the object [m]


@functools.cache
def round_robot() -> Robot:
    """
    Return the nine-member robot with tubes that stay round where they are touched, as MuJoCo's do.

    Its file says that a section resists flattening far more than by theory.
    """
    file = load_robot('nine_member').description
    return Robot(replace(file, local_stiffness=ROUND))


def move_to(
    plant: MujocoPlant, travel: Sequence[float] | Array, duration: float = 2.0, cycle: float = 0.01
) -> None:
    """
    Drive the rollers to a travel at even speeds, and let the robot come to rest.

    :param plant: the robot.
    :param travel: (r,) travel since home [m].
    :param duration: of the motion [s].
    :param cycle: of the commands [s].
    """
    speeds = (np.asarray(travel) - plant.travel) / duration
    for _ in range(round(duration / cycle)):
        plant.advance(cycle, speeds)
    plant.settle(REST)


def place(case: PressedCase) -> tuple[Configuration, ConvexObject]:
    """
    Return the configuration of a case, and the object in it.

    :param case: what presses.
    """
    config = closed_to(round_robot().home, case.degrees, case.diameter)
    center = tangent_center(config, MODULE, case.diameter, case.indentation)
    return config, ConvexObject.disc(center, case.diameter)


def press(
    case: PressedCase, friction: float = 0.0, options: PlantOptions = STILL
) -> tuple[MujocoPlant, Configuration, ConvexObject]:
    """
    Return a plant that presses on an object held fast, its configuration, and the object.

    :param case: what presses.
    :param friction: coefficient between tube and object while the tubes bend around it.
    :param options: of the plant.
    """
    config, cylinder = place(case)
    return press_on(config, cylinder, friction, options), config, cylinder


def press_on(
    config: Configuration,
    held: ConvexObject,
    friction: float = 0.0,
    options: PlantOptions = STILL,
) -> MujocoPlant:
    """
    Return a plant that presses on an object held fast at `MODULE`.

    :param config: where the robot is when it presses.
    :param held: the object, in its place.
    :param friction: coefficient between tube and object while the tubes bend around it.
    :param options: of the plant.
    """
    robot = config.robot
    segments = np.full(len(robot.member_names), options.segments)
    segments[find_members(robot, members_at(robot, MODULE)).members] = options.contact_segments
    plant = MujocoPlant(robot, [held], options, segments)
    plant.set_friction(friction)
    plant.hold_object(AWAY)
    move_to(plant, config.roller_positions)
    plant.hold_object(held.pose)
    plant.settle(2.0 * REST)
    return plant


def release(plant: MujocoPlant, friction: float, duration: float = 3.0) -> None:
    """
    Let go of the object: friction holds it from now on.

    :param plant: presses on an object held fast.
    :param friction: coefficient between tube and object.
    :param duration: until it is at rest [s].
    """
    plant.set_friction(friction)
    plant.release_object()
    plant.settle(duration)
