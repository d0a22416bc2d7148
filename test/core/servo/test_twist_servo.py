# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Decisions of the servo, which moves an object or a joint, from samples alone."""

import dataclasses
import math

from isotruss_ros import core
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.inputs import RejectedInput, RollerState, StampedInput
from isotruss_ros.core.safety.margins import shape_margins
from isotruss_ros.core.safety.roller_failure import FAILURE_TIME
from isotruss_ros.core.safety.shape_guard import ShapeBounds
from isotruss_ros.core.servo.servo_settings import ServoSettings
from nightly import some_now
import numpy as np
import pytest

FILE = core.load_robot('nine_member').description
ROBOT = core.Robot(dataclasses.replace(FILE, max_acceleration=np.inf))
MODULE, DIAMETER = 'north/Z', 0.3
CENTER = core.tangent_center(ROBOT.home, MODULE, DIAMETER)
GRIP = core.Grip.at_module(ROBOT, MODULE, core.ConvexObject.disc(CENTER, DIAMETER))
POSE = core.Pose(*CENTER, 0.0)
HOME = np.zeros(len(ROBOT.roller_names))
NOW, TWIST = 1000.0, [0.0, 0.02, 0.1]


def at(positions, velocities=0.0 * HOME):
    return RollerState(np.asarray(positions), np.asarray(velocities))


def servo(settings=None, robot=ROBOT, **given):
    """Return a servo with good inputs at NOW, or those given."""
    settings = {'period': 0.005, 'timeout': 0.2, 'max_object_acceleration': 1e3} | (settings or {})
    made = core.TwistServo(robot, ServoSettings(GRIP, **settings))
    made.receive(
        twist=StampedInput(TWIST, NOW),
        rollers=StampedInput(at(HOME), NOW),
        pose=StampedInput(POSE, NOW),
    )
    made.receive(**given)
    return made


def test_a_roller_that_fails_in_motion_is_commanded_zero_at_once():
    made = servo(robot=core.Robot(dataclasses.replace(FILE, max_acceleration=1.0)))
    made.command(np.full(len(HOME), 0.01), NOW - 0.01)
    made.receive(failed={ROBOT.roller_names[1]})
    command = made.decide(NOW).command
    assert command.status is core.Status.ACCELERATING
    assert command.roller_velocities[1] == 0.0


@pytest.mark.parametrize(
    ('name', 'stated'), [('twist', 'TWIST'), ('rollers', 'JOINT_STATES'), ('pose', 'OBJECT_POSE')]
)
def test_halts_with_the_status_of_each_input_fault(name, stated):
    good = getattr(servo().inputs, name)
    for given, fault in (
        (None, 'NO'),
        (good._replace(time=NOW - 0.201), 'NO' if name == 'twist' else 'STALE'),
        (RejectedInput('not a number'), 'INVALID'),
        (good._replace(time=NOW + 0.011), 'INVALID'),
    ):
        decision = servo(**{name: given}).decide(NOW)
        assert decision.command.status is core.Status[f'HALT_{fault}_{stated}']
        assert decision.message
        assert not decision.command.roller_velocities.any()
        assert decision.command.achieved_twist.tolist() == [0.0, 0.0, 0.0]
        assert decision.command.scale == 0.0
        assert (decision.squeeze, decision.pose_delay) == (None, 0.0)
        assert decision.frequency == decision.pose_gain == 0.0
        assert decision.twist.tolist() == ([0.0, 0.0, 0.0] if name == 'twist' else TWIST)


def test_the_status_of_a_slowed_twist_names_the_roller_at_its_limit():
    decision = servo(twist=StampedInput([0.0, 5.0, 0.0], NOW)).decide(NOW)
    assert decision.command.status is core.Status.SLOWED_ROLLER_SPEED
    assert f'by the limits of {decision.command.limiting[0]}' in decision.message


def test_the_status_states_the_age_of_a_late_twist_but_not_of_the_last_twist():
    last = servo().inputs.twist
    late, ended = (servo(twist=last._replace(time=NOW - age)).decide(NOW) for age in (0.3, 0.7))
    assert late.message.startswith('twist: 0.300 s old; must be at most 0.2 s')
    assert ended.message == 'nothing is commanded: the twists have ended'
    assert ended.command.status is core.Status.HALT_NO_TWIST


def moved(positions):
    """Return the servo's inputs of now, for a robot that has taken the object along."""
    there = ROBOT.configuration(positions)
    held = core.RollingGrip.attach(ROBOT.home, GRIP)
    return {
        'rollers': StampedInput(at(there.roller_positions), NOW),
        'pose': StampedInput(held.moved_to(there).pose, NOW),
    }


def close(late, exact):
    """Tell whether commands are the same, but for what is of second order in a way of a few mm."""
    return np.abs(late - exact).max() < 1e-5 * np.abs(exact).max()


@pytest.mark.parametrize('measured', [0.0, -1.0, 3.0])
def test_prediction_uses_commands_instead_of_measured_speeds(measured):
    made = servo({'period': 0.02})
    ways = [np.zeros(6)]
    for k in range(6):
        now = NOW + 0.02 * k
        made.receive(twist=StampedInput((0.02 * (-1) ** k, 0.02 + 0.01 * k, 0.1), now))
        sent = made.decide(now).command.roller_velocities
        ways.append(ways[-1] + 0.02 * sent)
    # All that is known is the state of 0.03 s after the beginning, in the second interval.
    now, seen = NOW + 0.12, 0.5 * (ways[1] + ways[2])
    state = moved(seen)
    made.receive(
        rollers=StampedInput(at(seen, measured * sent), NOW + 0.03),
        pose=state['pose']._replace(time=NOW + 0.03),
        twist=StampedInput((0.0, 0.02, 0.1), now),
    )
    late = made.decide(now).command.roller_velocities
    exact = servo(**moved(ways[-1] + 0.01 * sent)).decide(NOW).command.roller_velocities
    assert close(late, exact)
    assert not close(late, servo(**state).decide(NOW).command.roller_velocities)


def test_prediction_accounts_for_the_ages_of_rollers_and_pose():
    """The object is put where it was in the robot of that time, and has gone on with it."""
    exact = servo(**moved(np.array([4.0, 2.0, -5.0, 3.0, 4.0, -4.0]) * 1e-3))
    exact = exact.decide(NOW).command.roller_velocities
    speeds = np.array([4.0, 2.0, -5.0, 3.0, 4.0, -4.0]) * 1e-3 / 0.1
    for ages in ((0.1, 0.0), (0.0, 0.1), (0.05, 0.1), (0.1, 0.05)):
        seen = [moved((0.1 - age) * speeds) for age in ages]
        made = servo(
            {'period': 1e-9, 'max_object_acceleration': math.inf},
            rollers=StampedInput(at(seen[0]['rollers'].value.positions, speeds), NOW - ages[0]),
            pose=seen[1]['pose']._replace(time=NOW - ages[1]),
        )
        late = made.decide(NOW).command.roller_velocities
        assert np.abs(late - exact).max() < 1e-4 * np.abs(exact).max()


def test_failed_rollers_are_not_expected_to_move():
    made = servo()
    sent = made.decide(NOW).command.roller_velocities
    failed = int(np.abs(sent).argmax())
    made.receive(failed=[ROBOT.roller_names[failed]])
    now = NOW + 0.1
    made.receive(twist=StampedInput((0.0, 0.02, 0.1), now))
    late = made.decide(now).command.roller_velocities
    working = np.arange(len(HOME)) != failed
    there = servo(**moved((0.1 + 0.0025) * sent * working))
    there.receive(failed=made.failed)
    assert np.abs(late - there.decide(NOW).command.roller_velocities).max() < 1e-5


def test_failed_rollers_are_commanded_zero_and_reported():
    made = servo()
    made.receive(failed=['north/Z', 'south/Q'])
    decision = made.decide(NOW)
    speeds = dict(zip(ROBOT.roller_names, decision.command.roller_velocities, strict=True))
    assert speeds['north/Z'] == speeds['south/Q'] == 0.0
    assert any(speeds.values())
    assert decision.failed == ('south/Q', 'north/Z')
    # Four rollers suffice for any motion of the object that keeps the grip.
    assert decision.command.reachable_dof == 3
    made.receive(failed=['south/Q', 'north/Z', 'south/P'])
    assert made.decide(NOW).command.reachable_dof == 2
    made.receive(failed=['north/Z', 'south/Q'], twist=None)
    decision = made.decide(NOW)
    assert decision.failed == ('south/Q', 'north/Z')
    assert decision.command.reachable_dof == 0
    made.receive(failed=())
    assert made.decide(NOW).failed == ()


def run(made, robot, duration, twist=(0.0, 0.02, 0.1), begin=NOW):
    """Let a servo drive a simulated robot; return the decisions."""
    decisions, period = [], made.settings.period
    for k in range(round(duration / period)):
        now = begin + k * period
        made.receive(
            twist=StampedInput(np.asarray(twist), now),
            rollers=StampedInput(at(robot.config.roller_positions, robot.roller_velocities), now),
            pose=StampedInput(robot.object_pose, now),
        )
        decisions.append(made.decide(now))
        robot.command(decisions[-1].command.roller_velocities)
        robot.advance(period)
    return decisions


def simulated(*stuck):
    held = core.RollingGrip.attach(ROBOT.home, GRIP)
    faults = core.RollerFaults(stuck=frozenset(stuck))
    return core.SimulatedRobot(ROBOT.home, core.RigidObject(held), faults)


def test_stuck_roller_is_detected_and_the_object_moves_as_commanded_again():
    made = servo({'failure_time': FAILURE_TIME, 'period': 0.02})
    stuck = int(np.abs(made.decide(NOW).command.roller_velocities).argmax())
    name, robot = ROBOT.roller_names[stuck], simulated(ROBOT.roller_names[stuck])
    decisions = run(made, robot, 1.5)
    found = [k for k, decision in enumerate(decisions) if decision.failed == (name,)]
    first = found[0]
    assert 1.0 <= first * made.settings.period < 1.4
    assert made.failed == {name}
    assert len(found) == len(decisions) - first
    for decision in decisions[first:]:
        assert decision.command.roller_velocities[stuck] == 0.0
    # With the failure known the object does again what the command says.
    before = robot.object_pose
    decision = run(made, robot, 0.1, begin=NOW + 1.5)[-1]
    moved = (np.subtract(robot.object_pose, before))[:2] / 0.1
    assert moved == pytest.approx(decision.command.achieved_twist[:2], abs=2e-4)
    # Another servo takes the failures of the rollers that its robot has.
    for robot, taken in ((ROBOT, {name}), (core.load_robot('triangle'), set())):
        other = core.TwistServo(robot, made.settings)
        other.take_failures(made)
        assert other.failed == taken
    # It stays failed until somebody says otherwise.
    made.reset_failures([name])
    assert made.failed == set()


def test_rollers_that_are_held_by_a_halt_are_not_flagged():
    made, robot = servo({'failure_time': 0.5, 'period': 0.02}), simulated(*ROBOT.roller_names)
    made.receive(halt=(core.Status.HALT_EMERGENCY_STOP, 'stopped'))
    assert not any(decision.failed for decision in run(made, robot, 1.2))
    made.receive(halt=None)
    assert run(made, robot, 1.2, begin=NOW + 1.2)[-1].failed


def test_commands_older_than_the_timeout_predict_nothing():
    speeds = np.linspace(-0.02, 0.02, len(HOME))
    expected = servo(**moved(0.0 * HOME)).decide(NOW).command.roller_velocities
    for age, forgotten in ((0.19, False), (0.21, True)):
        made = servo()
        made.command(speeds, NOW - age)
        assert close(made.decide(NOW).command.roller_velocities, expected) == forgotten


#: Velocity (vx, vy) of a joint [m/s].
VELOCITY = (0.01, -0.02)


def joint_servo(joint, **settings):
    """Return a servo that moves a joint, without a pose of the object."""
    twist = StampedInput((*VELOCITY, 0.0), NOW)
    return servo({'joint': joint} | settings, twist=twist, pose=None)


def drive(made, twist, cycles):
    """Return the last command of a loop with perfect rollers, and where it ends."""
    config, velocities, period = ROBOT.home, HOME, made.settings.period
    for now in NOW + period * np.arange(cycles):
        made.receive(
            rollers=StampedInput(at(config.roller_positions, velocities), now),
            twist=StampedInput(twist, now),
        )
        command = made.decide(now).command
        velocities = command.roller_velocities
        config = config.moved_to(config.roller_positions + period * velocities)
    return command, config


@pytest.mark.parametrize('joint', ['Z', 'Q'])
def test_the_joint_moves_as_solved_and_no_pose_is_needed(joint):
    decision = joint_servo(joint).decide(NOW)
    expected = core.solve_joint_velocity(ROBOT.home, {joint: VELOCITY})
    assert decision.command.status is core.Status.OK
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
    made = joint_servo(joint, period=0.1, slide_along_limits=False)
    command, config = drive(made, twist, cycles)
    assert core.Status.SLOWED_ROLLER_SPEED < command.status < core.Status.UNREACHABLE
    assert command.scale < 0.02
    bounds, margins, file = ShapeBounds(), shape_margins(config), ROBOT.description
    assert margins.rigidity >= bounds.min_rigidity
    assert margins.clearance >= bounds.min_clearance - 1e-9
    assert config.member_lengths.min() >= file.min_length - 1e-6
    assert config.member_lengths.max() <= file.max_length + 1e-6


@pytest.mark.parametrize(('before', 'after'), [(None, 'Z'), ('Z', None), ('Z', 'Q')])
def test_a_change_of_what_moves_halts_until_the_next_twist(before, after):
    made = joint_servo(before)
    made.receive(pose=StampedInput(GRIP.body.pose, NOW))
    assert made.decide(NOW).command.status is core.Status.OK
    made.apply(dataclasses.replace(made.settings, joint=after))
    decision = made.decide(NOW)
    assert decision.command.status is core.Status.HALT_NO_TWIST
    assert not decision.command.roller_velocities.any()
    made.receive(twist=StampedInput((*VELOCITY, 0.0), NOW))
    assert made.decide(NOW).command.status is core.Status.OK
    made.apply(dataclasses.replace(made.settings, joint=after))
    assert made.decide(NOW).command.status is core.Status.OK


def test_a_joint_does_not_turn_and_must_exist():
    made = joint_servo('Z')
    for turn in (0.1, -0.1):
        made.receive(twist=StampedInput((*VELOCITY, turn), NOW))
        decision = made.decide(NOW)
        assert decision.command.status is core.Status.HALT_INVALID_TWIST
        assert 'must be 0' in decision.message
    with pytest.raises(GraspError, match='P, Q, R, X, Y, Z'):
        made.apply(dataclasses.replace(made.settings, joint='S'))
    assert made.settings.joint == 'Z'
