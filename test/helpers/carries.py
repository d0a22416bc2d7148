# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Objects that the nine-member robot carries, by how it grasps them at home."""

from dataclasses import replace

from held_grips import APART, BOX, LOOP
from isotruss_ros.core import ConvexObject, Disc, place_between, Robot, tangent_center
from isotruss_ros.core.manipulation.grip import members_at
from pressed_plants import round_robot, soften
from shapes import BRICK

MODULE, FRICTION = 'north/Z', 0.8
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
