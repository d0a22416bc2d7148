# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A simulated robot carries an object between two sides that meet at no module."""

from isotruss_ros.core import (
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
import numpy as np
import pytest

ROBOT = load_robot('nine_member')
SIDES = ('south/P-Q', 'north/R-P')
BOX = Polygon([(-0.25, -0.2), (0.25, -0.2), (0.25, 0.2), (-0.25, 0.2)], 0.02)


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
