# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A simulated object of one's own: glued to the middle of a member."""

from isotruss_ros.core import load_robot, RollerFaults, SimulatedRobot
from isotruss_ros.core.kinematics.depths import member_lines
from isotruss_ros.core.model.pose import Pose
import numpy as np
import pytest

ROBOT = load_robot('triangle')


class GluedObject:
    """An object in the middle of a member (by number), which it turns with."""

    def __init__(self, member):
        self._member = member

    def pose(self, config):
        """Return its pose."""
        start, end = member_lines(config)[self._member]
        middle = 0.5 * (start + end)
        return Pose(middle.real, middle.imag, float(np.angle(end - start)))

    def follow(self, config):
        """Go with the robot: nothing is remembered."""


def test_the_object_moves_with_the_simulated_robot():
    glued = GluedObject(1)
    robot = SimulatedRobot(ROBOT.home, glued, RollerFaults())
    robot.command(0.02 * np.ones(len(ROBOT.roller_names)))
    for _ in range(10):
        robot.advance(0.1)
    assert robot.object_pose != glued.pose(ROBOT.home)
    assert robot.object_pose == pytest.approx(glued.pose(robot.config))
