# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rare cases of control: other kinds of objects, equilibria that are lost, settings in between."""

import dataclasses

from isotruss_ros.core import (
    analyze_grasp,
    ConvexObject,
    Disc,
    HoldStatus,
    load_robot,
    place_between,
    settle_grasp,
    solve_twist,
    Status,
    TwistServo,
)
from isotruss_ros.core.control import twist_servo
from isotruss_ros.core.control.inputs import RejectedInput, RollerState, StampedInput
from isotruss_ros.core.control.squeeze_control import SqueezeControl, SqueezeSettings
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.manipulation.status import RollerCommand
from isotruss_ros.nodes.grasp.grasp_monitor import GraspMonitor
from isotruss_ros.nodes.grasp.grasp_report import GraspCode, GraspQuery
import numpy as np
import pytest

ROBOT = load_robot('nine_member')
REST = np.zeros(len(ROBOT.roller_names))
NOW, PERIOD, TIMEOUT, FRICTION = 1000.0, 0.02, 0.2, 0.9
MEMBERS = ('north/P-Z', 'north/Z-R')
GRIP = place_between(ROBOT.home, MEMBERS, Disc(0.3), indentation=0.01)
GRIP = dataclasses.replace(GRIP, friction=FRICTION)


@pytest.mark.parametrize('friction', [FRICTION, 0.4])
def test_the_monitor_analyzes_a_shape_where_it_is_measured(friction):
    body = ConvexObject(Disc(0.3))
    monitor = GraspMonitor(ROBOT, GraspQuery((), body, friction, (0.0, 0.0, 0.0), 0.005), TIMEOUT)
    monitor.rollers = StampedInput(RollerState(REST, REST), NOW)
    monitor.pose = StampedInput(GRIP.body.pose, NOW)
    report = monitor.report(NOW)
    assert report.code is GraspCode.OK
    there = body.moved_to(GRIP.body.pose)
    expected = analyze_grasp(ROBOT.home, there, friction, spacing=0.005)
    assert report.grasp.analysis.normal_forces == pytest.approx(expected.normal_forces)
    assert report.grasp.analysis.closure_residual == pytest.approx(expected.closure_residual)
    settled = settle_grasp(ROBOT.home, there, friction)
    assert report.held == settled.held == (friction == FRICTION)
    assert report.grasp.settled.pose == pytest.approx(settled.pose, abs=1e-9)
    monitor.pose = RejectedInput('none')
    assert not monitor.report(NOW).held


def controlled(force=10.0):
    """Return a control of the squeeze that holds the disc, and what solves twists for it."""

    def solve(twist, opening_rate):
        return solve_twist(ROBOT.home, GRIP, twist, opening_rate=opening_rate)

    control = SqueezeControl(SqueezeSettings(force))
    assert control.follow(ROBOT.home, GRIP, 0.0) is HoldStatus.HELD
    return control, solve


def test_an_indifferent_equilibrium_is_not_held(monkeypatch):
    control, _ = controlled()
    monkeypatch.setattr(HeldGrip, 'response', None)
    assert control.follow(ROBOT.home, GRIP, PERIOD) is HoldStatus.UNSTABLE
    assert control.grasp is None
    with pytest.raises(ValueError, match='follow comes before solve'):
        control.solve(np.zeros(3), PERIOD, solve_twist)


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
    assert control.reference == pytest.approx(control.belief.pose + control.belief.load.bias)


def squeezing_servo(velocities=REST):
    """Return a servo that regulates the squeeze of the disc, with good inputs at NOW."""
    servo = TwistServo(ROBOT, GRIP, period=PERIOD, timeout=TIMEOUT)
    servo.guard = None
    servo.twist = StampedInput((0.01, 0.02, 0.0), NOW)
    servo.rollers = StampedInput(RollerState(REST, np.array(velocities)), NOW)
    servo.pose = StampedInput(GRIP.body.pose, NOW)
    return servo


def test_what_twists_move_is_chosen_from_rest():
    servo = squeezing_servo()
    servo.squeeze = SqueezeControl(SqueezeSettings(10.0))
    assert servo.decide(NOW).command.status is Status.OK
    assert servo.squeeze.grasp is not None
    before = servo.twist
    servo.joint = None
    assert servo.twist is before
    servo.joint = 'Z'
    assert servo.twist is None
    assert servo.squeeze.grasp is None


class Halving:
    """A guard without limits that leaves half of every command."""

    limits = ()

    def watch(self, config, grip):
        return self

    def keep(self, command, velocities, duration):
        return command.slowed(0.5, Status.SLOWED_OBJECT, ())


def test_the_reference_moves_by_what_the_guard_leaves_of_a_twist():
    servo, references = squeezing_servo(), []
    servo.squeeze, servo.guard = SqueezeControl(SqueezeSettings(10.0)), Halving()
    for now in (NOW, NOW + PERIOD):
        command = servo.decide(now).command
        references.append(servo.squeeze.reference)
    assert command.scale == 0.5
    moved = references[1] - references[0]
    assert moved == pytest.approx(0.5 * PERIOD * np.array(servo.twist.value))


def test_commands_of_others_are_expected_to_be_carried_out():
    """As rollers that were measured at these speeds are expected to go on."""
    velocities, later = 0.02 * np.array([1.0, -1.0, 0.5, 1.0, -0.5, 1.0]), NOW + 0.03
    told, measured = squeezing_servo(), squeezing_servo(velocities)
    told.squeeze = SqueezeControl(SqueezeSettings(10.0))
    told.decide(NOW - PERIOD)
    told.note_command(velocities, NOW)
    assert told.squeeze.grasp is None
    told.squeeze = None
    one, other = told.decide(later).command, measured.decide(later).command
    assert one.status is other.status is Status.OK
    assert one.roller_velocities == pytest.approx(other.roller_velocities, abs=1e-9)
    still = squeezing_servo().decide(later).command
    assert one.roller_velocities != pytest.approx(still.roller_velocities, abs=1e-6)


@pytest.mark.parametrize(('silence', 'counts'), [(0.238, True), (0.242, False)])
@pytest.mark.parametrize('again', [False, True])
def test_commands_count_for_the_timeout_and_two_cycles(silence, counts, again):
    """With 0.2 s and cycles of 20 ms; those of before count for as long when another one comes."""
    velocities, later = 0.005 * np.array([1.0, -1.0, 0.5, 1.0, -0.5, 1.0]), NOW + silence

    def commanded(*commands):
        servo = squeezing_servo()
        for name in ('twist', 'rollers', 'pose'):
            setattr(servo, name, getattr(servo, name)._replace(time=NOW + 0.1))
        for speeds, time in commands:
            servo.note_command(speeds, time)
        return servo.decide(later).command.roller_velocities

    last = [(REST, later)] if again else []
    found, expected = commanded((velocities, NOW), *last), commanded(*last)
    assert (np.abs(found - expected).max() > 1e-9) == counts


def test_a_twist_that_would_take_too_much_speed_is_told(monkeypatch):
    command = RollerCommand(REST, np.zeros(3), 0.25, Status.SLOWED_ROLLER_SPEED)
    monkeypatch.setattr(twist_servo, 'solve_twist', lambda *arguments, **options: command)
    message = squeezing_servo().decide(NOW).message
    assert message == 'slowed to 25 %: the rest would take too much roller speed'
