# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The squeeze and the pose of a held object, regulated on the elastic plant."""

from dataclasses import replace
from functools import partial
import math

from grips import gripped, MASSLESS
from isotruss_ros.core import (
    ElasticObject,
    Grip,
    HoldStatus,
    RollerFaults,
    SimulatedRobot,
    Status,
    TwistServo,
)
from isotruss_ros.core.estimation.state_estimate import EstimatedTravel, EstimatorSettings
from isotruss_ros.core.estimation.state_estimator import StateEstimator
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.held_shape import held_joints
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.inputs import RollerState, StampedInput
from isotruss_ros.core.servo.servo_settings import ServoSettings, SqueezeSettings
from isotruss_ros.core.servo.squeeze_control import SqueezeControl
from nightly import some_now
import numpy as np
import pytest
from squeeze_loop import SqueezeLoop

CONFIG, CYLINDER = gripped(35.0, squeeze=0.1)
MODULE, FRICTION, PERIOD = 'north/Z', 0.5, 0.02


def measured_at(pose, friction=FRICTION):
    """Return the grip with the object in a place."""
    return Grip.at_module(CONFIG.robot, MODULE, CYLINDER.moved_to(pose), friction)


Loop = partial(SqueezeLoop, CONFIG, measured_at(CYLINDER.pose))


@pytest.mark.parametrize(
    'twist', some_now([[0.02, 0.02, -0.2], [0.04, -0.03, 0.0], [0.0, 0.0, 0.3]])
)
@pytest.mark.parametrize(
    ('duration', 'period', 'bound'),
    some_now([(0.4, PERIOD, 1e-4), (1.0, PERIOD, 1e-4), (1.0, 0.005, 3e-5)]),
)
def test_pose_and_squeeze_follow_their_references(twist, duration, period, bound):
    loop = Loop(period=period)
    loop.run(twist, duration)
    assert max(loop.errors) < bound
    assert loop.squeeze == pytest.approx(loop.target, rel=1e-3)
    assert np.degrees(abs(loop.error()[2])) < 0.02


def test_the_model_of_each_cycle_is_the_plant_in_its_configuration():
    loop = Loop()
    loop.run((0.02, 0.02, -0.2), 0.2)
    last = loop.plant.config
    loop.run((0.0, 0.0, 0.0), PERIOD)
    model = loop.control.belief.grasp
    assert model.config is last
    there = roll_grip(loop.object.grasp, last)
    assert model.pose == pytest.approx(there.pose, abs=1e-7)
    assert model.squeeze == pytest.approx(there.squeeze, rel=1e-5)


def test_unknown_load_changes_the_squeeze_little_and_not_the_pose():
    loop = Loop()
    assert loop.object.slip_margin > 3.0
    loop.object.external_wrench = (1.8, 2.4, 0.0)
    loop.run((0.02, 0.02, 0.0), 0.9)
    assert loop.squeeze == pytest.approx(loop.target, rel=0.04)
    assert loop.errors[-1] < 1e-4
    assert loop.control.belief.pose == pytest.approx(loop.plant.object_pose, abs=1e-4)


@pytest.mark.parametrize(
    ('gains', 'cycles', 'bound'), some_now([({}, 45, 3.5e-3), ({'pose_gain': 4.0}, 60, 9.5e-3)])
)
def test_an_unknown_rotating_load_moves_the_object_little(gains, cycles, bound):
    loop = Loop(**gains)
    for k in range(cycles):
        size, turn = min(3.0, 0.12 * k), 3.0 * PERIOD * k
        loop.object.external_wrench = (size * math.cos(turn), size * math.sin(turn), 0.0)
        loop.run((0.0, 0.0, 0.0), PERIOD)
    assert max(loop.errors) < bound


def test_softer_plant_has_less_squeeze_and_the_same_pose():
    loop = Loop(scale=0.7)
    loop.run((0.03, 0.0, 0.1), 0.4)
    assert 0.7 < loop.squeeze / loop.target < 0.75  # the dents do not become softer
    assert max(loop.errors) < 5e-4
    assert np.degrees(abs(loop.error()[2])) < 0.1


@pytest.mark.parametrize('deviation', [1e-3, 4e-2])
def test_deviation_of_the_squeeze_grows_with_that_of_the_zeros(deviation):
    loop = Loop()
    loop.run((0.0, 0.0, 0.0), 0.1)
    loop.control.take_offsets(np.zeros(6), deviation**2 * np.eye(6))
    belief = loop.control.belief
    found, spread = belief.squeeze, belief.squeeze_deviation
    assert found == pytest.approx(loop.target, rel=0.01)
    assert (spread > 0.5 * found) == (deviation > 5e-3)
    loop.control.lose()
    assert loop.control.belief is None


@pytest.mark.parametrize(
    ('zeros', 'more', 'duration', 'reduced'), [(1e-3, 0.8, 0.7, True), (4e-2, 0.6, 0.6, False)]
)
def test_only_a_known_squeeze_is_reduced(zeros, more, duration, reduced):
    loop = Loop(more=more, zero_deviation=zeros)
    first = loop.squeeze
    loop.run((0.02, 0.0, 0.0), duration)
    assert loop.squeeze == pytest.approx(loop.target if reduced else 0.92 * first, rel=0.02)


@pytest.mark.parametrize('size', some_now([1e-2, 1e-3]))
def test_corrected_offsets_agree_with_attaching_again(size):
    loop = Loop()
    loop.control.take_offsets(np.zeros(6), None)
    loop.run((0.0, 0.0, 0.0), 0.1)
    moved = size * np.array([0.3, -0.5, 0.2, -0.8, 0.4, 1.0])
    belief, before = loop.control.belief, loop.control.belief.grasp
    loop.control.take_offsets(moved, None)
    config = before.config.moved_to(before.config.roller_positions + moved)
    grip = loop.grip.moved_to(loop.plant.object_pose)
    assert loop.control.follow(config, grip, PERIOD) is HoldStatus.HELD
    assert belief.pose == pytest.approx(loop.plant.object_pose, abs=1e-4)
    fresh = SqueezeControl(loop.control.settings)
    assert fresh.follow(config, grip, PERIOD) is HoldStatus.HELD
    change = fresh.belief.squeeze - before.squeeze
    assert belief.squeeze - before.squeeze == pytest.approx(change, rel=0.3, abs=0.2)


def test_commands_toward_the_utilisation_bound_are_slowed():
    loop = Loop(force=40.0, max_utilisation=SqueezeSettings.max_utilisation)
    loop.run((0.0, 0.0, 0.0), 0.6)
    used = loop.object.grasp.sections.used.max()
    assert used == pytest.approx(1.0, abs=5e-3)
    assert used < 1.0 + 1e-9
    assert loop.statuses[-1] is Status.SLOWED_UTILISATION
    assert loop.squeeze < 30.0
    # The way back is free.
    loop.control.settings = replace(loop.control.settings, force=24.0)
    loop.statuses.clear()
    loop.run((0.0, 0.0, 0.0), 0.5)
    assert Status.SLOWED_UTILISATION not in loop.statuses
    assert loop.squeeze == pytest.approx(24.0, rel=5e-3)


@pytest.mark.parametrize(('zeros', 'held'), [(1e-2, True), (1e-3, False)])
def test_missing_friction_within_two_deviations_of_the_squeeze_is_no_halt(zeros, held):
    control = SqueezeControl(SqueezeSettings(10.0, zero_deviation=zeros))
    here = measured_at(attach_grip(CONFIG, CYLINDER).pose, friction=0.3)
    assert attach_grip(CONFIG, CYLINDER).required_friction > 0.35
    expected = HoldStatus.HELD if held else HoldStatus.SLIPS
    for _ in range(3):
        assert control.follow(CONFIG, here, PERIOD) is expected


# In the twist servo


def servo_on_plant(twist, cycles, force, rate=25.0, friction=FRICTION, late=1, **settings):
    """
    Run a twist servo that squeezes on the elastic plant; return both and the last decision.

    Its cycles come after `late` times its period.
    """
    plant_object = ElasticObject(CYLINDER, FRICTION)
    plant = SimulatedRobot(CONFIG, plant_object, RollerFaults())
    plant.advance(0.0)
    grip = measured_at(CYLINDER.pose, friction)
    settings = {'max_utilisation': math.inf} | MASSLESS | settings
    squeeze = SqueezeSettings(force, **settings)
    servo = TwistServo(
        CONFIG.robot, ServoSettings(grip, 1.0 / rate, 0.2, squeeze=squeeze, bounds=None)
    )
    codes = []
    for number in range(cycles):
        now = number * late / rate
        servo.receive(twist=StampedInput(twist, now))
        state = RollerState(plant.roller_positions.copy(), plant.roller_velocities.copy())
        servo.receive(rollers=StampedInput(state, now), pose=StampedInput(plant.object_pose, now))
        decision = servo.decide(now)
        codes.append(decision.command.status)
        plant.command(decision.command.roller_velocities)
        plant.advance(late / rate)
    return plant_object, plant, decision, codes


def test_the_servo_closes_in_place():
    start = ElasticObject(CYLINDER, FRICTION)
    start.follow(CONFIG)
    x, y, _ = start.pose(CONFIG)
    plant_object, plant, decision, codes = servo_on_plant((0.0, 0.0, 0.0), 26, 28.0)
    assert set(codes) <= {Status.OK, Status.ACCELERATING}
    assert decision.message == ''
    assert plant_object.grasp.squeeze == pytest.approx(28.0, rel=2e-3)
    assert plant.object_pose[:2] == pytest.approx((x, y), abs=1e-3)


@pytest.mark.nightly
def test_the_servo_carries_with_the_wanted_squeeze():
    start = ElasticObject(CYLINDER, FRICTION)
    start.follow(CONFIG)
    x, y, _ = start.pose(CONFIG)
    plant_object, plant, _, _ = servo_on_plant((0.02, -0.01, 0.0), 50, 24.0)
    assert plant_object.grasp.squeeze == pytest.approx(24.0, rel=5e-3)
    # Half a cycle is what the reference, in the middle of the first one, knows of the start.
    assert plant.object_pose[:2] == pytest.approx((x + 0.04, y - 0.02), abs=1e-3)


def test_servo_halts_without_an_equilibrium():
    _, plant, decision, codes = servo_on_plant(
        (0.01, 0.0, 0.0), 4, 24.0, friction=0.2, zero_deviation=1e-3
    )
    assert set(codes) == {Status.HALT_NOT_HELD}
    assert 'friction' in decision.message
    assert not decision.command.roller_velocities.any()
    assert plant.config is CONFIG


@pytest.mark.parametrize('late', some_now([3, 1]))
def test_late_loop_moves_the_object_by_the_commanded_distance(late):
    _, plant, _, _ = servo_on_plant((0.0, 0.0, 0.0), 1, 24.0)
    x, y = plant.object_pose[:2]
    carried, plant, _, codes = servo_on_plant((0.02, -0.01, 0.0), 21, 24.0, late=late)
    assert set(codes) <= {Status.OK, Status.ACCELERATING}
    assert carried.grasp.squeeze == pytest.approx(24.0, rel=5e-3)
    # Held for longer, a command is as much less exact.
    assert plant.object_pose[:2] == pytest.approx(
        (x + 0.016 * late, y - 0.008 * late), abs=8e-4 * late
    )


@pytest.mark.parametrize('degrees', some_now([1.0, -1.0]))
def test_an_object_at_rest_is_held_with_markers_in_a_turned_frame(degrees):
    held, grip = ElasticObject(CYLINDER, FRICTION), measured_at(CYLINDER.pose)
    plant, names = SimulatedRobot(CONFIG, held, RollerFaults()), CONFIG.robot.topology.joint_names
    plant.advance(0.0)
    squeeze = SqueezeSettings(held.grasp.squeeze)
    servo = TwistServo(
        CONFIG.robot, ServoSettings(grip, PERIOD, 0.2, squeeze=squeeze, bounds=None)
    )
    estimator = StateEstimator(CONFIG.robot, EstimatorSettings(stiffness=0.0))
    estimator.set_grip(grip)
    turn = np.exp(1j * np.radians(degrees))
    for number in range(12):
        now, readings = number * PERIOD, plant.roller_positions
        estimator.take_encoders(now, readings)
        estimator.take_pose(now, plant.object_pose, np.array([1e-3, 1e-3, 0.009]))
        seen = turn * (held_joints(held.grasp) @ [1.0, 1.0j])
        if number % 3 == 0:
            joints = dict(zip(names, np.stack([seen.real, seen.imag], axis=1), strict=True))
            estimator.take_markers(now, {name: joints[name] for name in ('Q', 'R', 'Z')}, 1e-3)
        found = estimator.estimate()
        state = RollerState(readings + found.offsets, np.zeros(6), found.offsets)
        known = EstimatedTravel(found.offsets, found.offset_covariance)
        servo.receive(
            twist=StampedInput((0.0, 0.0, 0.0), now),
            rollers=StampedInput(state, now),
            pose=StampedInput(plant.object_pose, now),
            estimate=StampedInput(known, now),
        )
        decision = servo.decide(now)
        assert decision.command.status < Status.HALT_NO_TWIST
        plant.command(decision.command.roller_velocities)
        plant.advance(PERIOD)
        error = servo.squeeze.belief.squeeze - held.grasp.squeeze
        assert abs(error) < 2.0 * found.squeeze_deviation


def held_by(pressures, control=None):
    """Return a controller of the object that is held with some pressures."""
    control = control or SqueezeControl(SqueezeSettings(20.0, **MASSLESS))
    control.take_pressures(pressures)
    model = attach_grip(CONFIG, CYLINDER, pressure=pressures, quick=True)
    assert control.follow(CONFIG, measured_at(model.pose), PERIOD) is HoldStatus.HELD
    return control


def test_model_uses_measured_pressures_from_the_start_and_in_motion():
    softer = (25e3, 30e3, 30e3)
    model = attach_grip(CONFIG, CYLINDER, pressure=softer, quick=True)
    assert held_by(softer).belief.grasp.squeeze == pytest.approx(model.squeeze, rel=1e-6)
    control = held_by(None)
    assert control.belief.grasp.squeeze > 1.01 * model.squeeze
    held_by(softer, control)
    assert control.belief.grasp.pressures == softer
    # Softer, it presses less; its contacts stay.
    assert control.belief.grasp.squeeze == pytest.approx(model.squeeze, rel=2e-3)
