# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A simulated object of one's own: glued to the middle of a member."""

from isotruss_ros.core import load_robot, RollerFaults, SimulatedRobot
from isotruss_ros.core.kinematics.depths import member_lines
from isotruss_ros.core.model.pose import Pose
import numpy as np
import pytest

ROBOT = load_robot('triangle')


class GluedObject:
    """
    An object in the middle of a member, which it turns with.

    :param member: number of the member.
    """

    def __init__(self, member):
        self._member = member

    def pose(self, config):
        """Return its pose."""
        start, end = member_lines(config)[self._member]
        middle = 0.5 * (start + end)
        return Pose(middle.real, middle.imag, float(np.angle(end - start)))

    def follow(self, config, elapsed):
        """Go with the robot: nothing is remembered."""

    def come_to_rest(self, config):
        """Take no note of it."""


def test_it_goes_with_the_simulated_robot():
    glued = GluedObject(1)
    robot = SimulatedRobot(ROBOT.home, glued, RollerFaults())
    robot.command(0.02 * np.ones(len(ROBOT.roller_names)))
    for _ in range(10):
        robot.advance(0.1)
    assert robot.object_pose != glued.pose(ROBOT.home)
    assert robot.object_pose == pytest.approx(glued.pose(robot.config))
