# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A box lies until two sides have closed around it, rolls with them, and is let go or lost."""

from isotruss_ros.core import (
    ConvexObject,
    Disc,
    load_robot,
    place_between,
    Polygon,
    RigidObject,
    RollerFaults,
    RollingGrip,
    SimulatedRobot,
    solve_twist_ahead,
)
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.manipulation.grip import find_contacts
from isotruss_ros.core.simulation.rigid_object import pressing_members
import numpy as np
import pytest

ROBOT = load_robot('nine_member')
SIDES = ('south/P-Q', 'north/R-P')
BOX = Polygon([(-0.25, -0.2), (0.25, -0.2), (0.25, 0.2), (-0.25, 0.2)], 0.02)


def gripped(depth=0.01, shape=BOX):
    """Return a shape between the two sides, this deep in both [m]."""
    return place_between(ROBOT.home, SIDES, shape, -0.5, depth)


def lying(body, friction=1.0):
    """Return a robot at home that has come to rest, and its object."""
    free = RigidObject(body, friction)
    robot = SimulatedRobot(ROBOT.home, free, RollerFaults())
    robot.advance(0.0)
    return robot, free


def test_names_the_members_that_press_deepest_first():
    assert set(pressing_members(ROBOT.home, gripped().body)) == set(SIDES)
    assert pressing_members(ROBOT.home, gripped(-0.01).body) == ()
    moved = gripped().body
    x, y, angle = moved.pose
    toward = find_contacts(ROBOT.home, gripped())[0].normal
    deeper = moved.moved_to((x + 0.002 * toward.real, y + 0.002 * toward.imag, angle))
    assert pressing_members(ROBOT.home, deeper) == SIDES


@pytest.mark.parametrize(
    ('center', 'diameter'), [((0.99, -0.1), 2.0), ((-0.4, -0.49), 1.0), ((-0.48, 0.52), 10.0)]
)
def test_no_two_members_press_on_an_object_that_tubes_lie_on(center, diameter):
    """The contact of such an object would take minutes to compute."""
    assert len(pressing_members(ROBOT.home, ConvexObject.disc(center, diameter))) < 2


def test_is_held_by_sides_that_press_and_moves_to_its_equilibrium():
    robot, free = lying(gripped().body)
    assert set(free.members) == set(SIDES)
    assert 0.0 < np.hypot(*np.subtract(robot.object_pose, gripped().body.pose)[:2]) < 0.01


def test_lies_where_nothing_presses_and_where_friction_is_too_little():
    for body, friction in ((gripped(-0.005).body, 1.0), (gripped().body, 0.05)):
        robot, free = lying(body, friction)
        assert free.members == ()
        robot.command([0.0, 0.02, 0.0, 0.0, 0.0, 0.0])
        robot.advance(0.1)
        assert robot.object_pose == pytest.approx(body.pose)


def test_its_own_friction_counts():
    body = gripped().body
    slippery = ConvexObject(body.shape, body.pose, friction=0.05)
    assert lying(slippery)[1].members == ()
    assert lying(ConvexObject(body.shape, body.pose, friction=1.0), 0.05)[1].members


def test_three_members_hold_as_well():
    triangle = load_robot('triangle')
    names = triangle.member_names
    disc = place_between(triangle.home, names, Disc(0.645))
    free = RigidObject(disc.body, 0.3)
    SimulatedRobot(triangle.home, free, RollerFaults()).advance(0.0)
    assert sorted(free.members) == sorted(names)


def simulated():
    """Return a robot at home with a box between two of its sides, and the box."""
    grip = place_between(ROBOT.home, SIDES, BOX, 0.2, 0.01)
    box = RigidObject.in_grip(RollingGrip.attach(ROBOT.home, grip))
    return SimulatedRobot(ROBOT.home, box, RollerFaults()), box


def test_carries_and_turns_the_box_as_commanded():
    robot, box = simulated()
    start = np.array(robot.object_pose)
    for _ in range(50):
        command = solve_twist_ahead(robot.config, box.rolling.grip, [0.02, 0.01, 0.05], 0.01)
        robot.command(command.roller_velocities)
        robot.advance(0.02)
    assert np.array(robot.object_pose) - start == pytest.approx([0.02, 0.01, 0.05], abs=1e-6)
    assert box.pose(robot.config) == box.rolling.pose
    assert box.lost is None
    assert box.rolling.config is robot.config
    # Where it would be in another configuration; looking does not move it.
    assert np.array(box.pose(ROBOT.home)) == pytest.approx(start, abs=1e-6)
    assert box.rolling.config is robot.config


def test_lies_where_the_members_left_it():
    robot, box = simulated()
    opening = np.array([0.1, 0.05, -0.1, 0.1, 0.1, -0.1])
    for _ in range(40):
        try:
            robot.command(opening)
            robot.advance(0.1)
        except ConfigurationError:
            break
        if box.lost is not None:
            break
    assert box.lost is not None
    assert 'does not' in box.lost
    lies = robot.object_pose
    assert box.rolling is None
    robot.command(-opening)
    robot.advance(0.1)
    assert robot.object_pose == lies
