# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Squeeze and pose of a disc between two members, controlled on the elastic plant."""

from dataclasses import replace
from functools import partial

from grips import gripped
from isotruss_ros.core import Grip, Status
from isotruss_ros.core.estimation import state_estimate
from isotruss_ros.core.holding.attach_grip import attach_grip
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
