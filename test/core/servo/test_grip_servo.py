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
    solve_twist,
    Status,
    TwistServo,
)
from isotruss_ros.core.inputs import RollerState, StampedInput
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.servo.servo_settings import ServoSettings, SqueezeSettings
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


def test_commands_what_solve_twist_finds_for_the_grip():
    grip = box_between()
    made = servo(grip.body.pose)
    decision = made.decide(NOW)
    expected = solve_twist(ROBOT.home, grip, (0.02, 0.0, 0.0))
    assert decision.command.status is Status.OK
    assert decision.command.achieved_twist == pytest.approx((0.02, 0.0, 0.0), abs=1e-9)
    assert decision.command.roller_velocities == pytest.approx(expected.roller_velocities)


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


def test_keeps_the_robot_clear_of_the_object():
    """Led away from the corner without end, it stops before anything hits the box."""
    box = RigidObject.in_grip(RollingGrip.attach(ROBOT.home, box_between()))
    robot = SimulatedRobot(ROBOT.home, box, RollerFaults())
    made, now = servo(robot.object_pose), NOW
    seen = set()
    for _ in range(200):
        made.receive(
            rollers=StampedInput(
                RollerState(robot.roller_positions, robot.roller_velocities), now
            ),
            pose=StampedInput(robot.object_pose, now),
            twist=StampedInput((-0.1, 0.0, 0.0), now),
        )
        decision = made.decide(now)
        seen.add(decision.command.status)
        robot.command(decision.command.roller_velocities)
        robot.advance(PERIOD)
        now += PERIOD
    assert box.rolling is not None
    assert any(10 <= status < 20 or status is Status.HALT_NO_GRASP for status in seen), seen


def test_regulates_the_squeeze_of_the_box():
    grip = box_between(depth=0.02)
    # It has 18 N there: the sides close on it for more, and open for less.
    for force, sign in ((25.0, -1.0), (12.0, 1.0)):
        made = servo(grip.body.pose, (0.0, 0.0, 0.0), squeeze=SqueezeSettings(force))
        command = made.decide(NOW).command
        assert command.status is Status.OK
        opening = grip_jacobian(ROBOT.home, grip)[3] @ command.roller_velocities
        assert sign * opening > 1e-3
        # The elastic tubes give by some millimetres.
        assert np.hypot(*command.achieved_twist[:2]) < abs(opening)
    pose = box_between(depth=-0.03).body.pose
    made = servo(pose, (0.0, 0.0, 0.0), squeeze=SqueezeSettings(25.0))
    assert made.decide(NOW).command.status is Status.HALT_NOT_HELD
