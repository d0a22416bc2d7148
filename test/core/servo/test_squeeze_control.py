# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Squeeze and pose of an object under control on the elastic plant, limits, and lost contacts."""

from dataclasses import replace
from functools import partial
import math

from grips import gripped
from held_grips import APART, AROUND, BOX, HOME, numbers
from isotruss_ros.core import Disc, Ellipse, Grip, place_between, Polygon, Pose, Robot, Status
from isotruss_ros.core.estimation import state_estimate
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.contact_search import measure_gaps
from isotruss_ros.core.holding.held_shape import lowest_frequency
from isotruss_ros.core.inputs import RollerState, StampedInput
from isotruss_ros.core.servo.servo_settings import SqueezeSettings
from nightly import some_now
import numpy as np
import pytest
from squeeze_loop import SqueezeLoop

CONFIG, CYLINDER = gripped(35.0, squeeze=0.1)
GRIP = Grip.at_module(CONFIG.robot, 'north/Z', CYLINDER, 0.5)
MODEL = attach_grip(CONFIG, CYLINDER)
PERIOD = 0.02
Loop = partial(SqueezeLoop, CONFIG, GRIP)


@pytest.mark.parametrize(
    'twist', some_now([[0.02, 0.02, -0.2], [0.04, -0.03, 0.0], [0.0, 0.0, 0.3]])
)
@pytest.mark.parametrize(
    ('duration', 'period', 'bound'),
    some_now([(0.4, PERIOD, 7e-4), (1.0, PERIOD, 3e-4), (1.0, 0.005, 8e-5)]),
)
def test_pose_and_squeeze_follow_their_references(twist, duration, period, bound):
    loop = Loop(period=period)
    loop.run(twist, duration)
    distance, angle = loop.largest_error()
    assert distance < bound
    assert angle < 10.0 * bound
    # In the shorter motion the rollers' acceleration is limited.
    assert loop.final_error() < (2e-4 if duration >= 1.0 else 2e-3)
    assert loop.squeeze == pytest.approx(loop.target, rel=1e-3)
    reported, _ = loop.decisions[-1].squeeze
    assert reported == pytest.approx(loop.squeeze, rel=2e-3)


def test_drift_beyond_the_contact_rows_is_fed_forward():
    """The pose gain is too low to correct it."""
    loop = Loop(pose_gain=0.01, period=0.05)
    loop.run((0.0, 0.0, 0.3), 1.0)
    assert loop.final_error() < 2e-4


@pytest.mark.parametrize(
    ('missing', 'gain', 'rate'),
    some_now([(1.0, 20.0, 5.0), (1.0, 2.0, 2.0), (-1.0, 20.0, 5.0)], 2),
)
def test_squeeze_error_decays_at_the_gain_up_to_5_per_second(missing, gain, rate):
    loop = Loop(force=MODEL.squeeze + missing, pose_gain=gain)
    errors = []
    for _ in range(15):
        loop.cycle()
        errors.append(loop.target - loop.squeeze)
    # In the first cycles the acceleration is limited.
    assert errors[-1] / errors[4] == pytest.approx((1.0 - PERIOD * rate) ** 10, rel=0.07)
    assert np.sign(errors[-1]) == np.sign(missing)


@pytest.mark.parametrize('missing', some_now([6.0, -6.0]))
def test_squeeze_changes_by_at_most_10_newton_per_second(missing):
    loop = Loop(force=MODEL.squeeze + missing)
    squeezes = [loop.cycle() and loop.squeeze for _ in range(12)]
    rates = np.diff(squeezes) / PERIOD
    assert np.abs(rates).max() == pytest.approx(10.0, rel=0.15)
    assert rates[-1] * missing > 0.0


def corrections(away, cycles, late=1, **settings):
    """Return the rate at which commands correct a pose error (m), over this error [1/s]."""
    loop = Loop(follows=False, servo={'timeout': 1.0}, **settings)
    for _ in range(10):
        loop.cycle(elapsed=late * loop.period)
    for _ in range(cycles):
        loop.cycle(elapsed=late * loop.period, away=(0.0, away, 0.0))
    velocities = [decision.command.achieved_twist[1] for decision in loop.decisions[10:]]
    return -np.array(velocities) / away


@pytest.mark.parametrize(('period', 'late'), [(0.02, 4), (0.08, 1)])
def test_pose_correction_takes_at_most_half_of_the_error_until_the_next_cycle(period, late):
    """Wrong offsets explain a part of the error, so the correction is about 0.4 of it."""
    share = 0.08 * corrections(4e-3, 8, late, period=period)[-1]
    assert 0.3 * 0.5 < share < 0.6 * 0.5


def test_pose_corrections_pass_two_low_pass_filters_with_the_time_constant_of_the_gain():
    gain = 4.0
    shares = corrections(2e-3, 26, pose_gain=gain) / gain
    one, two = (round(count / gain / PERIOD) for count in (1, 2))
    assert shares[one] < 1.0 - 2.0 / np.e < shares[two]


@pytest.mark.parametrize('sign', some_now([1.0, -1.0]))
def test_an_unknown_load_changes_the_squeeze_little_and_not_the_pose(sign):
    loop = Loop()
    loop.object.external_wrench = (1.8, 2.4 * sign, 0.0)
    loop.run((0.02, 0.02, 0.0), 0.4)
    assert loop.squeeze == pytest.approx(loop.target, rel=0.04)
    assert loop.final_error() < 2e-4


def test_softer_plant_has_less_squeeze_and_the_same_pose():
    loop = Loop(scale=0.7)
    loop.run((0.03, 0.0, 0.1), 0.3)
    assert 0.7 < loop.squeeze / loop.target < 0.75  # the dents do not become softer
    distance, angle = loop.largest_error()
    assert distance < 7e-4
    assert angle < 2e-3


@pytest.mark.parametrize(
    ('zeros', 'more', 'end'), [(1e-3, 0.8, 0.8), (4e-2, 0.6, 0.92), (4e-2, 1.1, 1.1)]
)
def test_a_squeeze_is_increased_and_only_a_known_one_is_reduced(zeros, more, end):
    loop, is_known = Loop(more=more, period=0.05, zero_deviation=zeros), zeros < 2e-3
    first = loop.squeeze
    loop.run((0.02, 0.0, 0.0), 0.7)
    assert loop.squeeze == pytest.approx(end * first, rel=0.03)
    assert state_estimate.is_squeeze_known(*loop.decisions[-1].squeeze) is is_known
    assert ('squeeze unknown' in loop.decisions[-1].message) is not is_known


@pytest.mark.parametrize('size', some_now([1e-2, 1e-3]))
def test_a_corrected_offset_changes_the_squeeze_and_not_the_pose(size):
    loop, moved = Loop(), size * np.array([0.3, -0.5, 0.2, -0.8, 0.4, 1.0])
    for _ in range(5):
        loop.cycle()
    positions = loop.plant.roller_positions + moved
    state = RollerState(positions, np.zeros(6), moved)
    decisions = [loop.cycle(rollers=StampedInput(state, loop.now)) for _ in range(2)]
    corrected = CONFIG.moved_to(positions)
    expected = attach_grip(corrected, CYLINDER.moved_to(loop.plant.object_pose)).squeeze
    assert decisions[-1].squeeze[0] == pytest.approx(expected, rel=0.05, abs=0.2)
    assert decisions[-1].desired_pose == pytest.approx(MODEL.pose, abs=3e-4)
    assert 'slipped' not in decisions[-1].message


def test_commands_toward_the_utilisation_bound_are_slowed():
    loop = Loop(40.0, period=0.04, max_utilisation=SqueezeSettings.max_utilisation)
    loop.run((0.0, 0.0, 0.0), 0.6)
    used = loop.object.grasp.sections.used.max()
    assert used == pytest.approx(1.0, abs=5e-3)
    assert used < 1.0 + 1e-6
    assert loop.statuses[-1] is Status.SLOWED_UTILISATION
    assert loop.squeeze < 30.0
    # The way back is free.
    settings = loop.servo.settings
    loop.servo.apply(replace(settings, squeeze=replace(settings.squeeze, force=24.0)))
    loop.decisions.clear()
    loop.run((0.0, 0.0, 0.0), 0.5)
    assert Status.SLOWED_UTILISATION not in loop.statuses
    assert loop.squeeze == pytest.approx(24.0, rel=5e-3)


@pytest.mark.parametrize(('zeros', 'held'), [(1e-2, True), (1e-3, False)])
def test_missing_friction_within_two_deviations_of_the_squeeze_is_no_halt(zeros, held):
    """The disc requires a coefficient of friction above 0.35."""
    grip = Grip.at_module(CONFIG.robot, 'north/Z', CYLINDER, 0.3)
    loop = SqueezeLoop(CONFIG, grip, 10.0, follows=False, friction=0.5, zero_deviation=zeros)
    decisions = [loop.cycle() for _ in range(3)]
    assert all((status is not Status.HALT_NOT_HELD) is held for status in loop.statuses)
    if not held:
        assert 'friction' in decisions[-1].message
        assert not decisions[-1].command.roller_velocities.any()


def test_gains_follow_from_the_settings_before_the_model():
    """A quarter of the lowest natural frequency, which is computed from masses if not measured."""
    heavy = replace(GRIP, body=replace(CYLINDER, mass=2.0))
    computed = lowest_frequency(attach_grip(CONFIG, heavy.body))
    for settings, gain, frequency in (
        ({}, 0.25 * computed, computed),
        ({'frequency': 8.0}, 2.0, 8.0),
        ({'frequency': 8.0, 'pose_gain': 3.0}, 3.0, 8.0),
    ):
        defaults = {'pose_gain': None, 'load': 0.0}
        decision = SqueezeLoop(CONFIG, heavy, **defaults | settings).cycle()
        assert decision.pose_gain == pytest.approx(gain, rel=1e-3)
        assert decision.frequency == pytest.approx(frequency, rel=1e-3)


def test_model_uses_measured_pressures_from_the_start_and_in_motion():
    softer = (25e3, 30e3, 30e3)
    model = attach_grip(CONFIG, CYLINDER, pressure=softer, quick=True)
    grip = Grip.at_module(CONFIG.robot, 'north/Z', model.body, 0.5)
    assert MODEL.squeeze > 1.01 * model.squeeze
    for before in (softer, None):
        loop = SqueezeLoop(CONFIG, grip, 20.0, follows=False, friction=0.5)
        for pressures in (before, softer, softer, softer):
            measured = None if pressures is None else StampedInput(pressures, loop.now)
            squeeze, _ = loop.cycle(pressures=measured).squeeze
        assert squeeze == pytest.approx(model.squeeze, rel=5e-3)


AWAY = (2e-3, -2e-3, 0.01)


def loop_of(friction=0.5, config=CONFIG, body=CYLINDER, force=MODEL.squeeze, **settings):
    grip = Grip.at_module(config.robot, 'north/Z', body, friction)
    return SqueezeLoop(config, grip, force, **settings)


def limited(**limits):
    """Return the configuration of a robot with other limits."""
    robot = Robot(replace(CONFIG.robot.description, **limits))
    return robot.configuration(CONFIG.roller_positions)


def repeat(loop, twist, count, **inputs):
    return [loop.cycle(twist, **inputs) for _ in range(count)]


def test_the_pose_error_takes_the_shorter_way_across_half_a_turn():
    x, y, _ = MODEL.pose
    loop = loop_of(body=CYLINDER.moved_to(Pose(x, y, math.pi - 0.01)))
    for _ in range(15):
        decision = loop.cycle((0.0, 0.0, 0.1))
        assert abs(decision.command.achieved_twist[2]) < 0.15
    turn = loop.plant.object_pose.angle - (math.pi - 0.01)
    assert math.remainder(turn, 2.0 * math.pi) == pytest.approx(0.03, abs=3e-3)


def test_a_pose_error_in_an_unreachable_direction_decays():
    """The desired pose follows the object there, and the twist is executed elsewhere."""
    loop = loop_of()
    loop.servo.receive(failed=['south/P', 'south/Q', 'east/R'])
    decision = repeat(loop, (0.02, -0.02, 0.1), 18)[-1]
    assert decision.command.status is Status.UNREACHABLE
    assert decision.desired_pose[:2] == pytest.approx(loop.plant.object_pose[:2], abs=2e-3)
    # At rest, a correction that the contacts do not admit is no fault.
    assert repeat(loop, (0.0, 0.0, 0.0), 3, away=AWAY)[-1].command.status < Status.SLIDING


@pytest.mark.nightly
def test_limits_of_rollers_slow_the_twist_and_not_the_squeeze():
    fast, slow = loop_of(force=24.5), loop_of(config=limited(max_speed=0.02), force=24.5)
    for _ in range(12):
        expected, decision = fast.cycle((0.05, 0.0, 0.0)), slow.cycle((0.05, 0.0, 0.0))
    assert expected.command.status is Status.OK
    command = decision.command
    assert command.status is Status.SLOWED_ROLLER_SPEED
    assert np.abs(command.roller_velocities).max() == pytest.approx(0.02)
    assert command.achieved_twist[0] == pytest.approx(0.05 * command.scale, rel=0.15)
    assert abs(slow.squeeze - slow.target) <= abs(fast.squeeze - fast.target)


def test_a_limit_below_the_closing_speed_stops_the_twist_and_not_the_squeeze():
    loop = loop_of(config=limited(max_speed=0.001), force=30.0)
    first = loop.squeeze
    command = repeat(loop, (0.05, 0.0, 0.0), 8)[-1].command
    assert (command.scale, command.status) == (0.0, Status.SLOWED_ROLLER_SPEED)
    assert command.limiting
    assert loop.squeeze > first


def test_a_low_slip_margin_slows_the_twist_and_not_the_correction_of_the_pose():
    """A hundredth of the squeeze remains."""
    loop, at_rest = loop_of(0.38), loop_of(0.38)
    for _ in range(9):
        command = loop.cycle((-0.03, 0.0, 0.0)).command
        at_rest.cycle()
    assert command.status is Status.SLOWED_SLIP_MARGIN
    assert command.limiting == ('the slip margin',)
    assert command.scale == 0.0
    assert loop.object.grasp.slip_margin(0.38) == pytest.approx(0.01 * loop.squeeze, rel=0.1)
    for _ in range(4):
        command = loop.cycle((-0.03, 0.0, 0.0), away=(0.0, 5e-4, 0.0)).command
        expected = at_rest.cycle(away=(0.0, 5e-4, 0.0)).command.achieved_twist
    assert command.status is Status.SLOWED_SLIP_MARGIN
    assert command.achieved_twist[1] == pytest.approx(expected[1], rel=0.1)
    assert loop.cycle(away=(0.0, 5e-3, 0.0)).command.status is Status.OK


@pytest.mark.parametrize(
    ('friction', 'load', 'slowed'),
    some_now([(0.38, 1.0, True), (0.4, -1.0, False), (0.385, 0.0, False)]),
)
def test_the_slip_margin_does_not_rely_on_an_estimated_load(friction, load, slowed):
    """The load changes the true margin by 0.5 N upward, or by 0.7 N downward."""
    loop = loop_of(friction)
    loop.object.external_wrench = (0.0, load, 0.0)
    scales = [decision.command.scale for decision in repeat(loop, (-0.03, 0.0, 0.0), 9)]
    assert (min(scales) == 0.0) is slowed


@pytest.mark.parametrize('was_held', [True, False])
def test_members_without_contact_are_a_loss_only_of_an_object_that_was_held(was_held):
    loop = loop_of(follows=False)
    if was_held:
        loop.cycle()
    closing = SqueezeLoop(CONFIG, loop.servo.settings.grip, 2.0 * MODEL.squeeze).cycle()
    opening = -closing.command.roller_velocities
    positions = CONFIG.roller_positions + 0.3 * opening / np.abs(opening).max()
    opened = StampedInput(RollerState(positions, 0.0 * opening), loop.now)
    decision = loop.cycle(rollers=opened)
    assert decision.command.status is Status.HALT_NO_GRASP
    assert decision.squeeze is None
    decision = repeat(loop, (0.0, 0.0, 0.0), 2)[-1]
    assert (decision.command.status is Status.HALT_NOT_HELD) is was_held
    assert ('pick up the object' in decision.message) is was_held


@pytest.mark.parametrize(
    ('twist', 'min_length'), some_now([((0.0, 0.0, 0.3), 0.74), ((0.02, 0.02, 0.0), 0.25)])
)
def test_object_is_at_the_desired_pose_while_it_slides_along_a_limit(twist, min_length):
    loop = loop_of(config=limited(min_length=min_length))
    for _ in range(36):
        loop.cycle(twist)
    distance, angle = loop.largest_error()
    assert distance < 3e-4
    assert angle < 3e-3
    # The scaled twist omits the motion along the limit.
    desired = np.array([decision.desired_pose for decision in loop.decisions])
    scales = sum(decision.command.scale for decision in loop.decisions)
    apart = math.dist(loop.period * scales * np.array(twist)[:2], (desired[-1] - desired[0])[:2])
    assert (apart > 1.5e-3) == (min_length > 0.5)
    at_rest = loop.cycle(twist=None)
    assert at_rest.desired_pose is None
    assert at_rest.squeeze is not None


def test_desired_pose_moves_with_the_command_of_an_accelerating_object():
    servo = {'max_object_acceleration': 0.1}
    loop = loop_of(config=limited(max_acceleration=0.2), servo=servo)
    decisions = [loop.cycle((0.0, 0.05, 0.0)) for _ in range(5)]
    assert {decision.command.status for decision in decisions} == {Status.ACCELERATING}
    moved = np.diff([decision.desired_pose for decision in decisions], axis=0)
    achieved = [decision.command.achieved_twist[1] for decision in decisions]
    assert max(achieved) < 0.05
    assert moved[:, 1] / loop.period == pytest.approx(achieved[:-1], abs=8e-4)


#: At home three members of three tubes close next to nothing around a disc.
OBLIQUE = HOME.moved_to(HOME.roller_positions + np.array([0.1, -0.1, 0.0, 0.1, -0.1, 0.05]))
#: The two that meet at a module.
CORNER = ('north/Z-R', 'north/P-Z')
LOW_BOX = Polygon([(-0.12, -0.1), (0.12, -0.1), (0.12, 0.1), (-0.12, 0.1)], 0.02)
SMALL_BOX = Polygon([(-0.08, -0.06), (0.08, -0.06), (0.08, 0.06), (-0.08, 0.06)], 0.02)


def loop_between(shape, angle, members, more=1.0, config=HOME, **settings):
    grip = place_between(config, members, shape, angle=angle, indentation=0.015)
    body = attach_grip(config, grip.body, numbers(members)).body
    return SqueezeLoop(config, Grip(members, body, 1.2), more=more, **settings)


@pytest.mark.parametrize(
    ('shape', 'angle', 'members'),
    some_now([(BOX, 0.2, APART), (Ellipse((0.25, 0.2)), 1.0, APART), (BOX, 0.2, AROUND[:2])]),
)
def test_pose_and_squeeze_of_a_grip_follow_their_references(shape, angle, members):
    loop = loop_between(shape, angle, members)
    loop.run((0.01, -0.01, 0.03), 0.3)
    distance, turn = loop.largest_error()
    assert distance < 2e-4
    assert turn < 2e-3
    assert loop.squeeze == pytest.approx(loop.target, rel=5e-3)


@pytest.mark.parametrize('noise', some_now([2e-3, 0.0]))
def test_a_box_that_lies_on_a_face_stays_held_and_is_not_told_as_unreachable(noise):
    """Its rows are not those of the corner on which it would be between straight members."""
    loop = loop_between(SMALL_BOX, 2.1, CORNER, 1.05, noise=noise)
    assert len(loop.object.grasp.contacts.members) == 3
    loop.run((0.0, 0.0, 0.0), 3 * loop.period)
    assert set(loop.statuses) <= {Status.OK, Status.IDLE, Status.ACCELERATING}
    loop.run((0.01, 0.01, 0.05), 0.2)
    assert loop.squeeze == pytest.approx(loop.target, rel=0.03 + 10.0 * noise)
    assert loop.final_error() < 1e-3 + noise


@pytest.mark.parametrize(
    ('shape', 'angle', 'members', 'config', 'more', 'duration'),
    some_now([(Disc(0.83), 0.0, AROUND, OBLIQUE, 1.1, 0.9), (BOX, 0.2, APART, HOME, 1.2, 1.3)]),
)
def test_a_rising_target_closes_in_place(shape, angle, members, config, more, duration):
    loop = loop_between(shape, angle, members, more, config, period=0.05)
    loop.run((0.0, 0.0, 0.0), duration)
    assert loop.squeeze == pytest.approx(loop.target, rel=5e-3)
    assert loop.final_error() < 1e-3


@pytest.mark.parametrize('twist', some_now([((0.02, 0.0, -0.2),), ((0.0, 0.02, -0.1),)]))
def test_the_velocity_does_not_jump_where_a_face_comes_to_lie_on_a_member(twist):
    loop, poses = loop_between(LOW_BOX, 0.62, CORNER), []
    for share in np.linspace(0.0, 1.0, 12).tolist() + 12 * [1.0]:
        loop.cycle(share * np.array(twist))
        poses.append(loop.plant.object_pose[:2])
    velocities = np.diff(poses, axis=0) / loop.period
    assert np.hypot(*np.diff(velocities, axis=0).T).max() < 3e-3
    grip = measure_gaps(loop.object.grasp, 1.2)
    assert min(gap.width for gap in grip.gaps) < 3e-3  # it lies on the member, but for this gap
