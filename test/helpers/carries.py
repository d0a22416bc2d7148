# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Objects that the twist servo carries in MuJoCo, by what it would be told of them."""

from dataclasses import replace

from comparison.carrying import RATE, Regulated
from comparison.grips import hold_at_home, round_robot, soften
from isotruss_ros.core import (
    ConvexObject,
    Disc,
    Grip,
    place_between,
    Polygon,
    Pose,
    Robot,
    tangent_center,
)
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.servo.squeeze_control import SqueezeSettings
from isotruss_ros.mujoco_plant.options import PlantOptions
import numpy as np

MODULE, FRICTION = 'north/Z', 0.8
LOOP = ('south/P-Q', 'south/Q-X', 'south/X-P')
APART = ('south/P-Q', 'north/R-P')
BOX = Polygon([(-0.25, -0.2), (0.25, -0.2), (0.25, 0.2), (-0.25, 0.2)], corner_radius=0.02)
BRICK = Polygon([(-0.15, -0.1), (0.15, -0.1), (0.15, 0.1), (-0.15, 0.1)], corner_radius=0.02)
#: Shape, members and angle of each grasp of the nine-member robot at home.
GRASPS = {
    'disc 0.1 m': (Disc(0.1), (), 0.0),
    'disc 0.2 m': (Disc(0.2), (), 0.0),
    'disc 0.3 m': (Disc(0.3), (), 0.0),
    'box': (BOX, APART, -0.5),
    'brick': (BRICK, ('north/P-Z', 'north/Z-R'), 0.0),
    'three members': (Disc(0.65), LOOP, 0.0),
}


def make_robot(module_mass=1.0, stiffness=1.0):
    """Return the nine-member robot with round tubes, so many times as stiff as the file's."""
    file = round_robot().description
    robot = Robot(replace(file, module=replace(file.module, mass=module_mass)))
    return robot if stiffness == 1.0 else soften(robot, stiffness)


def place(robot, name, mass):
    """Return the object of a grasp where it is held, and the names of the members."""
    shape, members, angle = GRASPS[name]
    if members:
        body = place_between(robot.home, members, shape, angle=angle, indentation=0.02).body
    else:
        members = members_at(robot, MODULE)
        deep = 0.02 if shape.diameter > 0.15 else 0.012
        center = tangent_center(robot.home, MODULE, shape.diameter, deep)
        body = ConvexObject.disc(center, shape.diameter)
    return replace(body, mass=mass, friction=FRICTION), members


def mujoco_plant(robot, body, members):
    """Return the MuJoCo plant with an object in the grip, at rest."""
    return hold_at_home(robot, body, members, PlantOptions(friction=FRICTION))


class Carry(Regulated):
    """
    An object in MuJoCo, and the servo that carries it by late and noisy measurements.

    :ivar errors: (n, 3) of the object against its twists, turns times its arm [m].
    """

    def __init__(
        self,
        grasp,
        masses=(1.0, 0.5),
        told=1.0,
        stiffness=1.0,
        late=0,
        noise=(0.0, 0.0),
        seed=0,
        **settings,
    ):
        """
        Put the object between the members, and regulate how hard they press.

        :param grasp: name of one of `GRASPS`.
        :param masses: of module and object in the plant [kg].
        :param told: masses in the model over those of the plant.
        :param stiffness: of the plant's tubes over those of the model.
        :param late: cycles by which poses are late.
        :param noise: standard deviation of the poses [m, rad].
        """
        robot = make_robot(told * masses[0])
        body, members = place(robot, grasp, told * masses[1])
        made = mujoco_plant(
            make_robot(masses[0], stiffness), replace(body, mass=masses[1]), members
        )
        numbers = np.array([robot.member_names.index(name) for name in members])
        there = body.moved_to(made.object_pose())
        squeeze = SqueezeSettings(attach_grip(robot.home, there, numbers).squeeze, **settings)
        grip = Grip(members, body, FRICTION)
        super().__init__(made, robot, grip, squeeze, (*noise, seed), late)
        self.even = np.array([1.0, 1.0, body.arm])
        self.goal = np.array(made.object_pose())
        self.errors, self._told = [], None

    def measure(self):
        """Return what is measured; a pose that is told counts in its place."""
        rollers, pose = super().measure()
        return rollers, pose if self._told is None else Pose(*self._told)

    def step(self, twist=(0.0, 0.0, 0.0), pose=None):
        """Carry for one cycle; a pose is told in place of the measured one."""
        self._told = pose
        super().step(twist)
        self.goal = self.goal + self.scale * np.array(twist) / RATE
        self.errors.append(self.even * (np.array(self.plant.object_pose()) - self.goal))

    def push(self, wrench, duration=0.1):
        """Push the object for a while, which nobody tells the servo."""
        self.plant.pull(wrench)
        self.run(duration)
        self.plant.pull((0.0, 0.0, 0.0))

    def swings(self, seconds):
        """Return how far the object was from where it came to rest, in each second [m]."""
        count, rest = round(seconds * RATE), round(0.5 * RATE)
        errors = np.array(self.errors[-count:])
        away = np.hypot.reduce(errors - errors[-rest:].mean(axis=0), axis=1)
        return away.reshape(seconds, -1).max(axis=1)
