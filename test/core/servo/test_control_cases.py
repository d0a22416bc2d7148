# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rare cases of control: other kinds of objects, equilibria that are lost, settings in between."""

import dataclasses

from isotruss_ros.core import (
    Disc,
    HoldStatus,
    load_robot,
    place_between,
    solve_twist,
    Status,
    TwistServo,
)
from isotruss_ros.core.inputs import RollerState, StampedInput
from isotruss_ros.core.servo.servo_settings import ServoSettings, SqueezeSettings
from isotruss_ros.core.servo.squeeze_control import SqueezeControl
import numpy as np
import pytest

ROBOT = load_robot('nine_member')
REST = np.zeros(len(ROBOT.roller_names))
NOW, PERIOD, TIMEOUT, FRICTION = 1000.0, 0.02, 0.2, 0.9
MEMBERS = ('north/P-Z', 'north/Z-R')
GRIP = place_between(ROBOT.home, MEMBERS, Disc(0.3), indentation=0.01)
GRIP = dataclasses.replace(GRIP, friction=FRICTION)


def controlled(force=10.0):
    """Return a control of the squeeze that holds the disc, and what solves twists for it."""

    def solve(twist, opening_rate):
        return solve_twist(ROBOT.home, GRIP, twist, opening_rate=opening_rate)

    control = SqueezeControl(SqueezeSettings(force))
    assert control.follow(ROBOT.home, GRIP, 0.0) is HoldStatus.HELD
    return control, solve


def test_a_direction_that_limits_bend_ends_the_reference():
    control, solve = controlled()

    def sliding(twist, opening_rate):
        return dataclasses.replace(solve(twist, opening_rate), status=Status.SLIDING)

    twist = np.array([0.01, -0.02, 0.05])
    control.advance(twist, control.solve(twist, PERIOD, sliding))
    assert control.reference is None
    # The next one is from where the object is then.
    control.follow(ROBOT.home, GRIP, PERIOD)
    control.solve(twist, PERIOD, solve)
    assert control.reference == pytest.approx(control.belief.regulated_pose)


def test_the_reference_moves_by_what_acceleration_admits_of_a_twist():
    settings = ServoSettings(
        GRIP,
        period=PERIOD,
        timeout=TIMEOUT,
        squeeze=SqueezeSettings(10.0),
        bounds=None,
        max_acceleration=0.2,
    )
    servo, twist = TwistServo(ROBOT, settings), (0.01, 0.02, 0.0)
    references, achieved = [], []
    for now in (NOW, NOW + PERIOD):
        servo.receive(
            twist=StampedInput(twist, now),
            rollers=StampedInput(RollerState(REST, REST), now),
            pose=StampedInput(GRIP.body.pose, now),
        )
        achieved.append(servo.decide(now).command.achieved_twist)
        references.append(servo.squeeze.reference)
    assert np.abs(achieved[0]).max() < 0.2 * max(twist)
    assert references[1] - references[0] == pytest.approx(PERIOD * achieved[0], abs=1e-9)
