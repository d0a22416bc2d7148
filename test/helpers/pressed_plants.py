# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""MuJoCo plants with an object in a wedge of the nine-member robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
import functools

from isotruss_ros.core import Configuration, ConvexObject, load_robot, tangent_center
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.statics.structure import structure_of
from isotruss_ros.core.statics.tube_stiffness import tube_pressures
from isotruss_ros.mujoco_plant.options import PlantOptions, RIGID_SECTION_STIFFNESS
from isotruss_ros.mujoco_plant.plant import MujocoPlant
import numpy as np
from wedge import closed_to, MODULE

#: Pose x, y [m], angle [rad] of the object outside of the wedge while it closes.
AWAY = (5.0, 5.0, 0.0)
#: Options with a drag that damps soft modes quickly, for states at rest.
STILL = PlantOptions(joint_drag=25.0)
#: Duration of a motion of the rollers, period of its commands, and rest after it [s].
MOTION, CYCLE, REST = 2.0, 0.01, 1.0
#: Numbers of segments of members in contact, and of other members [-], and the number for objects
#: that are carried or not round. Five boxes carried without faults end with an error of the
#: squeeze of up to 1.5 %; with 8 segments, of up to 3.5 % in half of the time.
NEAR, COARSE, FINE = 8, 4, 16


@dataclass(frozen=True)
class PressedCase:
    """An object pressed into a wedge."""

    degrees: float  #: opening angle of the wedge at `MODULE` [degrees]
    shift: float  #: distance of the object from the tangent center toward the corner [m]
    diameter: float = 0.3  #: diameter of the object [m]


@functools.cache
def round_robot() -> Robot:
    """
    Return the nine-member robot without flattening, as in MuJoCo.

    Its robot file has a stiffness against flattening far above the theory.
    """
    file = load_robot('nine_member').description
    return Robot(replace(file, local_stiffness=RIGID_SECTION_STIFFNESS))


def soften(robot: Robot, stiffness: float) -> Robot:
    """
    Return a robot with scaled tube stiffness and unchanged flattening.

    :param robot: the robot.
    :param stiffness: ratio of the new stiffness to that of the given robot [-].
    """
    description = robot.description
    rigidity = structure_of(robot.home).tube.section_stiffness(
        robot.home.member_lengths[:1], np.array([tube_pressures(description, None)[0]])
    )
    names = ('axial_rigidity', 'flexural_rigidity', 'shear_rigidity')
    block = {name: stiffness * float(each[0]) for name, each in zip(names, rigidity, strict=True)}
    return Robot(replace(description, stiffness={'model': 'section', **block}))


def mesh(robot: Robot, members: Sequence[str], segments: int = NEAR) -> Indices:
    """
    Return the number of segments of each member, (m,).

    :param robot: the robot.
    :param members: names of the members in contact.
    :param segments: number of segments of the members in contact.
    """
    return np.where(np.isin(robot.member_names, members), segments, COARSE)


def move_to(plant: MujocoPlant, travel: Sequence[float] | Array) -> None:
    """
    Move the rollers to given travel at constant speeds, and wait until the robot rests.

    :param plant: the robot.
    :param travel: (r,) roller travel since home [m].
    """
    speeds = (np.asarray(travel) - plant.travel) / MOTION
    for _ in range(round(MOTION / CYCLE)):
        plant.advance(CYCLE, speeds)
    plant.settle(REST)


def place(case: PressedCase) -> tuple[Configuration, ConvexObject]:
    """
    Return the configuration of a case, and the object in it.

    :param case: wedge and object.
    """
    config = closed_to(round_robot().home, case.degrees, case.diameter)
    center = tangent_center(config, MODULE, case.diameter, case.shift)
    return config, ConvexObject.disc(center, case.diameter)


def press(
    case: PressedCase, options: PlantOptions = STILL, segments: int = NEAR
) -> tuple[MujocoPlant, Configuration, ConvexObject]:
    """
    Return a plant in contact with a fixed object, its configuration, and the object.

    :param case: wedge and object.
    :param options: options of the plant.
    :param segments: number of segments of the members in contact.
    """
    config, cylinder = place(case)
    members = members_at(config.robot, MODULE)
    return press_on(config, cylinder, members, options, segments), config, cylinder


def press_on(
    config: Configuration,
    held: ConvexObject,
    members: Sequence[str],
    options: PlantOptions = STILL,
    segments: int = NEAR,
) -> MujocoPlant:
    """
    Return a plant in contact with a fixed object, without friction.

    :param config: configuration with contact.
    :param held: the object at its pose.
    :param members: names of the members in contact.
    :param options: options of the plant.
    :param segments: number of segments of the members in contact.
    """
    plant = MujocoPlant(config.robot, held, options, mesh(config.robot, members, segments))
    plant.set_friction(0.0)
    plant.hold_object(AWAY)
    move_to(plant, config.roller_positions)
    plant.hold_object(held.pose)
    plant.settle(2.0 * REST)
    return plant


def hold_at_home(
    robot: Robot,
    body: ConvexObject,
    members: Sequence[str],
    options: PlantOptions,
) -> MujocoPlant:
    """
    Return a plant at home with an object in the grip, at rest.

    :param robot: the robot.
    :param body: object; it is fixed until the tubes have bent around it.
    :param members: names of the members that hold it.
    :param options: options of the plant.
    """
    plant = MujocoPlant(robot, body, options, mesh(robot, members, FINE))
    plant.hold_object(body.pose)
    plant.settle(REST)
    plant.release_object()
    plant.settle(REST)
    return plant


def release(plant: MujocoPlant, friction: float, duration: float = 3.0) -> None:
    """
    Release the fixed object, which only friction holds from then on.

    :param plant: plant in contact with a fixed object.
    :param friction: coefficient of friction between tube and object.
    :param duration: simulated time after the release [s].
    """
    plant.set_friction(friction)
    plant.release_object()
    plant.settle(duration)
