# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Objects that the twist servo carries in a plant, by what it would be told of them."""

from collections import deque
from dataclasses import replace

from comparison.elastic_plant import ElasticPlant
from isotruss_ros.core import (
    ConvexObject,
    Disc,
    place_between,
    Polygon,
    Pose,
    Robot,
    tangent_center,
    TwistServo,
)
from isotruss_ros.core.control.inputs import RollerState, StampedInput
from isotruss_ros.core.control.squeeze_control import SqueezeControl, SqueezeSettings
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.model.robot_file import read_robot_file
from isotruss_ros.core.statics.section import tube_pressures
from isotruss_ros.core.statics.structure import structure_of
from isotruss_ros.mujoco_plant.options import PlantOptions, ROUND
from isotruss_ros.mujoco_plant.plant import MujocoPlant
import numpy as np

MODULE, FRICTION, RATE = 'north/Z', 0.8, 100
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
    file = read_robot_file('nine_member')
    file = replace(file, local_stiffness=ROUND, module=replace(file.module, mass=module_mass))
    if stiffness == 1.0:
        return Robot(file)
    robot = Robot(file)
    structure = structure_of(robot.home)
    pressure = tube_pressures(file, None)[0]
    rigidity = structure.tube.section_stiffness(
        robot.home.member_lengths[:1], np.array([pressure])
    )
    names = ('axial_rigidity', 'flexural_rigidity', 'shear_rigidity')
    block = {name: stiffness * float(each[0]) for name, each in zip(names, rigidity, strict=True)}
    return Robot(replace(file, stiffness={'model': 'section', **block}))


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


def elastic_plant(robot, body):
    """Return the elastic plant with an object in the grip, at rest."""
    return ElasticPlant(robot, body, FRICTION)


def mujoco_plant(robot, body):
    """Return the MuJoCo plant with an object in the grip, at rest."""
    options = PlantOptions(friction=FRICTION, module_mass=robot.description.module.mass)
    plant = MujocoPlant(robot, [body], options)
    plant.hold_object(body.pose)
    plant.settle(1.0)
    plant.release_object()
    plant.settle(1.0)
    return plant


class Carry:
    """
    An object in a plant, and the servo that carries it by late and noisy measurements.

    :ivar errors: (n, 3) of the object against its twists, turns times its arm [m].
    :ivar statuses: of the commands.
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
        plant=mujoco_plant,
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
        :param plant: makes it of robot and object.
        """
        robot = make_robot(told * masses[0])
        body, members = place(robot, grasp, told * masses[1])
        true = make_robot(masses[0], stiffness)
        self.plant = plant(true, replace(body, mass=masses[1]))
        numbers = np.array([robot.member_names.index(name) for name in members])
        there = body.moved_to(self.plant.object_pose())
        target = attach_grip(robot.home, there, numbers).squeeze
        self.control = SqueezeControl(SqueezeSettings(target, FRICTION, **settings))
        self.servo = TwistServo(robot, '', 1.0, 1.0 / RATE, 0.5)
        self.servo.members, self.servo.body = members, body
        self.servo.friction, self.servo.squeeze = FRICTION, self.control
        self.even = np.array([1.0, 1.0, body.arm])
        self.goal = np.array(self.plant.object_pose())
        self.errors, self.statuses, self.messages = [], [], set()
        self._seen = deque(maxlen=late + 1)
        self._noise = np.array([noise[0], noise[0], noise[1]])
        self._rng = np.random.default_rng(seed)

    def step(self, twist=(0.0, 0.0, 0.0), pose=None):
        """Carry for one cycle; a pose is told in place of the measured one."""
        now, servo = self.plant.time, self.servo
        measured = np.array(self.plant.object_pose()) + self._noise * self._rng.normal(size=3)
        self._seen.append(StampedInput(Pose(*measured), now))
        servo.pose = self._seen[0] if pose is None else StampedInput(Pose(*pose), now)
        servo.rollers = StampedInput(RollerState(self.plant.travel, self.plant.speeds), now)
        servo.twist = StampedInput(tuple(twist), now)
        decision = servo.decide(now)
        self.plant.advance(1.0 / RATE, decision.command.roller_velocities)
        self.goal = self.goal + decision.command.scale * np.array(twist) / RATE
        self.errors.append(self.even * (np.array(self.plant.object_pose()) - self.goal))
        self.statuses.append(decision.command.status)
        self.messages.add(decision.message)

    def run(self, duration, twist=(0.0, 0.0, 0.0)):
        """Carry by a twist that begins and ends at rest."""
        count = round(duration * RATE)
        for k in range(count):
            rate = 1.0 - np.cos(2.0 * np.pi * (k + 0.5) / count)
            self.step(rate * np.array(twist))

    def push(self, wrench, duration=0.1):
        """Push the object for a while, which nobody tells the servo."""
        self.plant.pull(wrench)
        self.run(duration)
        self.plant.pull((0.0, 0.0, 0.0))

    def swings(self, seconds):
        """Return how far the object was from where it came to rest, in each second [m]."""
        count, rest = seconds * RATE, RATE // 2
        errors = np.array(self.errors[-count:])
        away = np.hypot.reduce(errors - errors[-rest:].mean(axis=0), axis=1)
        return away.reshape(seconds, RATE).max(axis=1)
