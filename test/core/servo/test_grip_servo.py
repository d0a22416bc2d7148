# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The servo with grips of any members: a box between two sides that meet at no module."""

from boxes import BOX, box_between, ROBOT, SIDES
from isotruss_ros.core import (
    Grip,
    Pose,
    read_object,
    RigidObject,
    RollerFaults,
    RollingGrip,
    SimulatedRobot,
    Status,
    TwistServo,
)
from isotruss_ros.core.inputs import RollerState, StampedInput
from isotruss_ros.core.servo.servo_settings import ServoSettings
import numpy as np
import pytest

NOW, PERIOD = 1000.0, 0.02
HOME = np.zeros(len(ROBOT.roller_names))


def servo(pose, twist=(0.02, 0.0, 0.0), members=SIDES, **settings):
    """Return a servo with good inputs at NOW, whose robot holds the box."""
    grip = Grip(members, read_object(BOX), 0.9)
    settings = {'timeout': 0.2, 'max_acceleration': np.inf} | settings
    made = TwistServo(ROBOT, ServoSettings(grip, PERIOD, **settings))
    made.receive(
        twist=StampedInput(twist, NOW),
        rollers=StampedInput(RollerState(HOME, HOME), NOW),
        pose=StampedInput(Pose(*pose), NOW),
    )
    return made


def test_twist_is_projected_onto_the_contact_constraints():
    # Three members leave no rolling: whatever turns the object is out of reach.
    grip = box_between()
    turned = servo(grip.body.pose, (0.0, 0.0, 1.0))
    turned.receive(failed=ROBOT.roller_names[:4])
    decision = turned.decide(NOW)
    assert decision.command.status is Status.UNREACHABLE
    assert 'would leave the contacts; the closest one that keeps them is' in decision.message


def test_follows_a_path_and_returns_with_late_measurements():
    """The box goes and turns as commanded, though poses and joint states come a cycle late."""
    box = RigidObject.in_grip(RollingGrip.attach(ROBOT.home, box_between()))
    robot = SimulatedRobot(ROBOT.home, box, RollerFaults())
    start = np.array(robot.object_pose)
    made, now = servo(start), NOW
    for twist in ((0.02, 0.01, 0.05), (-0.02, -0.01, -0.05)):
        for _ in range(50):
            made.receive(
                rollers=StampedInput(
                    RollerState(robot.roller_positions, robot.roller_velocities), now
                ),
                pose=StampedInput(robot.object_pose, now),
            )
            now += PERIOD
            robot.advance(PERIOD)
            made.receive(twist=StampedInput(twist, now))
            decision = made.decide(now)
            assert decision.command.status is Status.OK, decision.message
            robot.command(decision.command.roller_velocities)
        if twist[0] > 0.0:
            went = np.array(robot.object_pose) - start
            # The last command has not been carried out.
            assert went == pytest.approx(49 * PERIOD * np.array(twist), abs=2e-5)
    robot.advance(PERIOD)
    assert np.array(robot.object_pose) == pytest.approx(start, abs=2e-5)
    assert box.rolling.misfit < 1e-5
