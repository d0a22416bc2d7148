# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Desired pose of the held object in the decisions of the twist servo, on the elastic plant."""

from dataclasses import replace
import math

from grips import gripped, MASSLESS
from isotruss_ros.core import ElasticObject, Grip, Robot, RollerFaults, SimulatedRobot, TwistServo
from isotruss_ros.core.inputs import RollerState, StampedInput
from isotruss_ros.core.servo.servo_settings import ServoSettings, SqueezeSettings
import numpy as np
import pytest

CONFIG, BODY = gripped(35.0, squeeze=0.1)
PERIOD = 0.02


def carry(twist, cycles, min_length):
    """Return mid-cycle poses of the object and the decisions of a loop with a length limit."""
    robot = Robot(replace(CONFIG.robot.description, min_length=min_length))
    held = ElasticObject(BODY, 0.5)
    plant = SimulatedRobot(robot.configuration(CONFIG.roller_positions), held, RollerFaults())
    plant.advance(0.0)
    squeeze = SqueezeSettings(held.grasp.squeeze, max_utilisation=math.inf, **MASSLESS)
    grip = Grip.at_module(robot, 'north/Z', BODY, 0.5)
    servo = TwistServo(robot, ServoSettings(grip, PERIOD, 0.2, squeeze=squeeze, bounds=None))
    poses, decisions = [np.array(plant.object_pose)], []
    for now in PERIOD * np.arange(cycles):
        state = RollerState(plant.roller_positions, plant.roller_velocities)
        pose = StampedInput(plant.object_pose, now)
        servo.receive(twist=StampedInput(twist, now), rollers=StampedInput(state, now), pose=pose)
        decisions.append(servo.decide(now))
        plant.command(decisions[-1].command.roller_velocities)
        plant.advance(PERIOD)
        poses.append(np.array(plant.object_pose))
    servo.receive(twist=None)
    decisions.append(servo.decide(now + PERIOD))
    return 0.5 * np.add(poses[1:], poses[:-1]), decisions


@pytest.mark.parametrize(
    ('twist', 'min_length'), [((0.0, 0.0, 0.3), 0.74), ((0.02, 0.02, 0.0), 0.25)]
)
def test_object_is_at_the_desired_pose_while_it_slides_along_a_limit(twist, min_length):
    poses, (*decisions, at_rest) = carry(twist, 60, min_length)
    desired = np.array([decision.desired_pose for decision in decisions])
    assert np.abs(desired - poses)[:, :2].max() < 2e-4
    assert np.abs(desired - poses)[:, 2].max() < 3e-3
    # The scaled twist omits the motion along the limit.
    scaled = PERIOD * sum(each.command.scale for each in decisions) * np.array(twist)
    apart = math.hypot(*(scaled - (desired[-1] - desired[0]))[:2])
    assert (apart > 3e-3) == (min_length > 0.5)
    assert at_rest.desired_pose is None
    assert at_rest.squeeze is not None
