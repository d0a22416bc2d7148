# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Desired pose of the held object in the decisions of the twist servo, on the elastic plant."""

from dataclasses import replace
import math

from grips import gripped
from isotruss_ros.core import Grip, Robot, Status
import numpy as np
import pytest
from squeeze_loop import SqueezeLoop

CONFIG, BODY = gripped(35.0, squeeze=0.1)


def loop_with(**limits):
    """Return a loop with a disc in a robot with other limits."""
    robot = Robot(replace(CONFIG.robot.description, **limits))
    config = robot.configuration(CONFIG.roller_positions)
    return SqueezeLoop(config, Grip.at_module(robot, 'north/Z', BODY, 0.5))


@pytest.mark.parametrize(
    ('twist', 'min_length'), [((0.0, 0.0, 0.3), 0.74), ((0.02, 0.02, 0.0), 0.25)]
)
def test_object_is_at_the_desired_pose_while_it_slides_along_a_limit(twist, min_length):
    loop = loop_with(min_length=min_length)
    for _ in range(60):
        loop.cycle(twist)
    distance, angle = loop.largest_error()
    assert distance < 3e-4
    assert angle < 3e-3
    # The scaled twist omits the motion along the limit.
    desired = np.array([decision.desired_pose for decision in loop.decisions])
    scales = sum(decision.command.scale for decision in loop.decisions)
    apart = math.dist(loop.period * scales * np.array(twist)[:2], (desired[-1] - desired[0])[:2])
    assert (apart > 3e-3) == (min_length > 0.5)
    at_rest = loop.cycle(twist=None)
    assert at_rest.desired_pose is None
    assert at_rest.squeeze is not None


def test_desired_pose_moves_with_the_command_of_an_accelerating_object():
    loop = loop_with(max_acceleration=0.2)
    decisions = [loop.cycle((0.0, 0.05, 0.0)) for _ in range(5)]
    assert {decision.command.status for decision in decisions} == {Status.ACCELERATING}
    moved = np.diff([decision.desired_pose for decision in decisions], axis=0)
    achieved = [decision.command.achieved_twist[1] for decision in decisions]
    assert max(achieved) < 0.05
    assert moved[:, 1] / loop.period == pytest.approx(achieved[:-1], abs=8e-4)
