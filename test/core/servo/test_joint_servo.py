# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The servo in the mode in which twists move a joint, without an object."""

from dataclasses import replace

from grips import disc_grip
from isotruss_ros.core import load_robot, Robot, solve_joint_velocity, Status, TwistServo
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.inputs import RollerState, StampedInput
from isotruss_ros.core.safety.margins import shape_margins
from isotruss_ros.core.safety.shape_guard import ShapeBounds
from isotruss_ros.core.servo.servo_settings import ServoSettings
from nightly import some_now
import numpy as np
import pytest

ROBOT = Robot(replace(load_robot('nine_member').description, max_acceleration=np.inf))
GRIP = disc_grip(ROBOT.home, 'north/Z')
NOW, PERIOD = 1000.0, 0.005
VELOCITY = (0.01, -0.02)
REST = np.zeros(len(ROBOT.roller_names))


def servo(joint, **settings):
    """Return a servo that moves a joint, with joint states and a twist, but without a pose."""
    settings = {'period': PERIOD, 'timeout': 0.2} | settings
    made = TwistServo(ROBOT, ServoSettings(GRIP, joint=joint, **settings))
    made.receive(
        rollers=StampedInput(RollerState(REST, REST), NOW),
        twist=StampedInput((*VELOCITY, 0.0), NOW),
    )
    return made


def drive(made, twist, cycles):
    """Return the last command of a loop with perfect rollers, and where it ends."""
    config, velocities, period = ROBOT.home, REST, made.settings.period
    for now in NOW + period * np.arange(cycles):
        made.receive(
            rollers=StampedInput(RollerState(config.roller_positions, velocities), now),
            twist=StampedInput(twist, now),
        )
        command = made.decide(now).command
        velocities = command.roller_velocities
        config = config.moved_to(config.roller_positions + period * velocities)
    return command, config


@pytest.mark.parametrize('joint', ['Z', 'Q'])
def test_the_joint_moves_as_solved_and_no_pose_is_needed(joint):
    decision = servo(joint).decide(NOW)
    expected = solve_joint_velocity(ROBOT.home, {joint: VELOCITY})
    assert decision.command.status is Status.OK
    assert decision.command.roller_velocities == pytest.approx(expected.roller_velocities)
    assert decision.command.achieved_twist == pytest.approx([*VELOCITY, 0.0], abs=1e-10)
    assert decision.command.reachable_dof == expected.reachable_dof == 2


@pytest.mark.parametrize(
    ('joint', 'twist', 'cycles'),
    some_now(
        [('Q', (0.2, 0.0, 0.0), 62), ('Q', (-0.1, -0.2, 0.0), 120), ('Z', (0.0, -0.2, 0.0), 150)]
    ),
)
def test_barriers_and_limits_stop_the_joint(joint, twist, cycles):
    made = servo(joint, period=0.1, slide_along_limits=False)
    command, config = drive(made, twist, cycles)
    assert Status.SLOWED_ROLLER_SPEED < command.status < Status.UNREACHABLE
    assert command.scale < 0.02
    bounds, margins, file = ShapeBounds(), shape_margins(config), ROBOT.description
    assert margins.rigidity >= bounds.min_rigidity
    assert margins.clearance >= bounds.min_clearance - 1e-9
    assert config.member_lengths.min() >= file.min_length - 1e-6
    assert config.member_lengths.max() <= file.max_length + 1e-6


@pytest.mark.parametrize(('before', 'after'), [(None, 'Z'), ('Z', None), ('Z', 'Q')])
def test_a_change_of_what_moves_halts_until_the_next_twist(before, after):
    made = servo(before)
    made.receive(pose=StampedInput(GRIP.body.pose, NOW))
    assert made.decide(NOW).command.status is Status.OK
    made.apply(replace(made.settings, joint=after))
    decision = made.decide(NOW)
    assert decision.command.status is Status.HALT_NO_TWIST
    assert not decision.command.roller_velocities.any()
    made.receive(twist=StampedInput((*VELOCITY, 0.0), NOW))
    assert made.decide(NOW).command.status is Status.OK
    made.apply(replace(made.settings, joint=after))
    assert made.decide(NOW).command.status is Status.OK


def test_a_joint_does_not_turn_and_must_exist():
    made = servo('Z')
    for turn in (0.1, -0.1):
        made.receive(twist=StampedInput((*VELOCITY, turn), NOW))
        decision = made.decide(NOW)
        assert decision.command.status is Status.HALT_INVALID_TWIST
        assert 'must be 0' in decision.message
    with pytest.raises(GraspError, match='P, Q, R, X, Y, Z'):
        made.apply(replace(made.settings, joint='S'))
    assert made.settings.joint == 'Z'
