# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Estimated pose, squeeze, delay and slip of a held object, and equilibria between samples."""

from dataclasses import replace
from functools import cache
import math

from carries import make_robot
from grips import gripped, MASSLESS
from isotruss_ros.core import Grip, place_between, Polygon, Pose, Status
from isotruss_ros.core.estimation.equilibrium_cache import (
    attach_model,
    MAX_ERRORS,
    TravelPrediction,
)
from isotruss_ros.core.estimation.grip_belief import ContactWalk, GripBelief, PoseNoise
from isotruss_ros.core.estimation.state_estimate import EstimatorSettings
from isotruss_ros.core.estimation.state_estimator import StateEstimator
from isotruss_ros.core.holding.grip_record import GripRecord
from isotruss_ros.core.holding.held_grip import HoldStatus
from isotruss_ros.core.holding.held_shape import held_joints
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.inputs import StampedInput
from isotruss_ros.core.manipulation.grip import CornerGap
from isotruss_ros.core.model.pose import pose_difference
from isotruss_ros.core.servo.servo_settings import SqueezeSettings
from isotruss_ros.core.servo.squeeze_control import SqueezeControl
from nightly import some_now
import numpy as np
import pytest

CONFIG, CYLINDER = gripped(35.0, squeeze=0.1)
GRIP = Grip.at_module(CONFIG.robot, 'north/Z', CYLINDER)
MODEL = attach_model(CONFIG, GRIP)
ARM = np.array([1.0, 1.0, MODEL.arm])
DEVIATIONS = np.array([1e-3, 1e-3, 0.009])
#: Amplitude of the roller speeds [m/s], which change with a period of 1 s.
SPEED = np.array([8e-3, -5e-3, 4e-3, -6e-3, 3e-3, -7e-3])


@cache
def rolled(count, period, scale):
    """Return the equilibrium after a count of periods of travel there and back."""
    if count == 0:
        return MODEL
    travel = np.sin(2.0 * np.pi * count * period) * scale * SPEED
    config = CONFIG.moved_to(CONFIG.roller_positions + travel)
    return roll_grip(rolled(count - 1, period, scale), config)


def start(offsets=0.0, grip=GRIP, config=CONFIG, pose=MODEL.pose, **settings):
    """Return an estimator after encoders with wrong offsets and one pose."""
    estimator = StateEstimator(config.robot, EstimatorSettings(**settings))
    estimator.set_grip(grip)
    estimator.take_encoders(0.0, config.roller_positions + offsets)
    assert estimator.take_pose(0.0, Pose(*pose), DEVIATIONS)
    return estimator


class Carry:
    """
    Estimator of an object that moves there and back.

    :ivar grasp: equilibrium of the object.
    """

    def __init__(self, scale=1.0, noise=0.0, encoders=0.0, period=0.05, delay=0.0, age=0.0):
        """
        Start at the equilibrium.

        :param scale: factor on `SPEED`.
        :param noise: standard deviation of the poses, rotations times the arm [m].
        :param encoders: standard deviation of the readings [m].
        :param delay: time by which poses are older than their stamps [s].
        :param age: time by which stamps are older than the readings [s].
        """
        self.estimator, self.rng, self.number = start(), np.random.default_rng(0), 0
        self.scale, self.noise, self.encoders, self.period = scale, noise, encoders, period
        self.delay, self.age, self.poses, self.grasp = delay, age, [np.array(MODEL.pose)], MODEL

    def run(self, duration, offset=(0.0, 0.0, 0.0)):
        """Move and measure, with a constant offset of the pose; return the estimate."""
        for _ in range(round(duration / self.period)):
            self.number += 1
            count = self.number % round(1.0 / self.period)
            grasp = self.grasp = rolled(count, self.period, self.scale)
            self.poses.append(np.array(grasp.pose))
            time = self.number * self.period
            readings = grasp.config.roller_positions + self.encoders * self.rng.normal(size=6)
            self.estimator.take_encoders(time, readings)
            before = round((self.age + self.delay) / self.period)
            pose = self.poses[max(self.number - before, 0)] + offset
            pose = pose + self.noise * self.rng.normal(size=3) / ARM
            self.estimator.take_pose(max(time - self.age, 0.0), Pose(*pose), DEVIATIONS)
        return self.estimator.estimate()


@pytest.mark.parametrize(
    ('duration', 'settings', 'delay'),
    [
        (2.0, {'scale': 4.0, 'delay': 0.05}, 0.05),
        (0.5, {'noise': 1e-3, 'delay': 0.05}, 0.05),
        (1.5, {'scale': 4.0}, 0.0),
        (1.5, {'scale': 4.0, 'delay': -0.05, 'age': 0.05}, 0.0),  # newer than their stamps
        (1.0, {'noise': 2e-4, 'encoders': 1e-4, 'period': 0.02}, 0.0),
    ],
)
def test_the_delay_of_poses_is_estimated_and_not_negative(duration, settings, delay):
    found = Carry(**{'noise': 1e-4} | settings).run(duration).delay
    assert 0.0 <= found == pytest.approx(delay, abs=0.02 if delay else 0.01)


@pytest.mark.parametrize('age', [0.1, 0.25])
def test_a_late_pose_is_compared_with_the_motion_up_to_its_stamp(age):
    carry = Carry(scale=2.0, age=age)
    found = carry.run(1.2)
    assert np.linalg.norm(carry.poses[-1] - carry.poses[-1 - round(age / 0.05)]) > 2e-3
    assert found.pose == pytest.approx(carry.poses[-1], abs=2e-4)


@pytest.mark.parametrize('noise', some_now([2e-3, 2e-4]))
def test_errors_of_the_pose_in_white_noise_agree_with_stated_deviations(noise):
    carry, squares = Carry(noise=noise), []
    carry.run(1.5)
    for _ in range(30):
        found = carry.run(0.1)
        error = found.pose - carry.poses[-1]
        squares.append(error @ np.linalg.solve(found.pose_covariance, error) / 3.0)
    assert np.mean(squares) < 1.5


def test_noise_of_poses_is_estimated_from_their_steps():
    deviation, rng = 2e-3, np.random.default_rng(0)
    noise = PoseNoise(np.full(60, 1e-6))
    for k in range(300):
        noise = noise.added(1e-4 * k + deviation * rng.normal(size=60))
    assert np.mean(noise.variances) == pytest.approx(deviation**2, rel=0.1)


def test_an_earlier_walk_and_a_jump_of_the_derivatives_by_offsets_are_no_slip():
    rates, jump = np.eye(3, 6), np.ones((3, 6))
    covariances, offsets = (1e-6 * np.eye(3), 1e-6 * np.eye(3)), 1e-4 * np.eye(6)
    walk = ContactWalk(walk=np.eye(3))
    walk = walk.added(0.0, np.zeros(3), *covariances, rates, offsets)
    walk = replace(walk, jumps=jump)
    step = 0.1, np.array([2e-3, 0.0, 0.0]), *covariances
    slipped = walk.added(*step, rates + jump, offsets)
    assert slipped.deviations == pytest.approx(2e-3 / math.sqrt(2e-6))


def test_a_constant_offset_of_the_pose_is_no_squeeze():
    carry, offset = Carry(scale=0.0, noise=1e-4), (3e-3, 0.0, 0.0)
    before = carry.run(3.0).squeeze
    after = carry.run(3.0, offset)
    assert after.squeeze == pytest.approx(before, rel=0.03)
    assert after.pose == pytest.approx(np.add(carry.poses[-1], offset), abs=5e-4)


def test_a_received_grip_has_the_joints_and_the_object_of_its_sender():
    measured = np.add(MODEL.pose, (2e-3, -1e-3, 0.01))
    belief = GripBelief.of(MODEL, GRIP.moved_to(measured), EstimatorSettings())
    record = GripRecord.of(belief.held, belief.estimate)
    estimator = StateEstimator(CONFIG.robot)
    estimator.set_grip(GRIP)
    estimator.take_encoders(0.0, record.travel)
    estimator.take_grip(record)
    found = estimator.estimate()
    restored = record.restore(CONFIG, GRIP.body)
    assert found.joints == pytest.approx(held_joints(restored), abs=1e-12)
    assert found.pose == pytest.approx(measured, abs=1e-3)
    assert (*found.pose, found.squeeze, found.delay) == (*belief.pose, belief.squeeze, 0.0)
    # After the last message of the loop, the estimator tracks the object again.
    assert not estimator.take_pose(0.0, Pose(*MODEL.pose), DEVIATIONS)
    estimator.take_grip(None)
    assert estimator.estimate().pose is None
    assert estimator.take_pose(0.0, Pose(*MODEL.pose), DEVIATIONS)


def test_markers_correct_the_offsets_alike_with_a_received_and_a_tracked_grip():
    grip = GRIP.moved_to(MODEL.pose)
    belief = GripBelief.of(MODEL, grip, EstimatorSettings(), noise=DEVIATIONS)
    received = StateEstimator(CONFIG.robot)
    received.set_grip(GRIP)
    received.take_encoders(0.0, CONFIG.roller_positions)
    received.take_grip(GripRecord.of(belief.held, belief.estimate))
    estimates = []
    for estimator in (start(), received):
        joints = np.add(estimator.estimate().joints, (2e-3, -1e-3))
        markers = {name: joints[CONFIG.robot.topology.joint_names.index(name)] for name in 'QRZ'}
        assert estimator.take_markers(0.0, markers, 1e-3)
        estimates.append(estimator.estimate())
    tracked, found = estimates
    assert np.abs(found.offsets).max() > 1e-4
    assert found.offsets == pytest.approx(tracked.offsets, abs=1e-12)
    assert found.joints == pytest.approx(tracked.joints, abs=1e-12)
    assert found.joint_covariance == pytest.approx(tracked.joint_covariance, abs=1e-12)


def test_the_slip_margin_is_that_of_contacts_before_they_slid():
    measured = np.add(MODEL.pose, (2e-3, -1e-3, 0.01))
    belief = GripBelief.of(MODEL, GRIP.moved_to(measured), EstimatorSettings())
    margin = MODEL.slip_margin(GRIP.friction)
    assert abs(belief.held.slip_margin(GRIP.friction) - margin) > 0.005 * margin
    assert belief.slip_margin == pytest.approx(margin, rel=1e-6)


def test_a_jump_is_in_part_a_shift_of_the_contacts_which_changes_the_squeeze():
    shifts = np.array([12e-3, -12e-3])
    slid = roll_grip(MODEL.with_anchors(MODEL.anchors + shifts), CONFIG)
    belief = GripBelief.of(MODEL, GRIP.moved_to(MODEL.pose), EstimatorSettings())
    jumped = belief.observed(Pose(*slid.pose), 0.0)
    assert jumped.state.jump > 0.0
    share = (jumped.squeeze - belief.squeeze) / (slid.squeeze - belief.squeeze)
    assert 0.2 < share < 1.0


@pytest.mark.parametrize('away', [(4e-3, -2e-3, 0.02), (8e-3, 0.0, 0.0)])
def test_a_search_changes_neither_pose_nor_squeeze_for_control(away):
    belief = GripBelief.of(MODEL, GRIP.moved_to(MODEL.pose), EstimatorSettings())
    belief = belief.observed(Pose(*np.add(MODEL.pose, away)), 0.0)
    searched, _ = replace(belief, search_due=HoldStatus.HELD).followed(CONFIG, 0.01, None)
    assert searched.cache is not belief.cache
    regulated = [each.outputs - each.corrections for each in (belief, searched)]
    assert regulated[1] == pytest.approx(regulated[0], abs=1e-5)


def test_rates_of_displaced_joints_are_those_at_other_offsets():
    def belief(offsets):
        model = attach_model(CONFIG.moved_to(CONFIG.roller_positions + offsets), GRIP)
        return GripBelief.of(model, GRIP.moved_to(MODEL.pose), EstimatorSettings())

    rates = belief(0.0).estimate.displacement_rates
    for step, rate in zip(1e-4 * np.eye(6), rates.T, strict=True):
        ends = [belief(way * step).estimate.displacements for way in (1.0, -1.0)]
        assert (ends[0] - ends[1]) / 2e-4 == pytest.approx(rate, abs=2e-4)


def test_error_of_the_squeeze_with_wrong_offsets_agrees_with_stated_deviations():
    ratios = []
    for seed in range(12):
        offsets = 0.005 * np.random.default_rng(seed).normal(size=6)
        found = start(offsets, zero_deviation=0.005, stiffness=0.0).estimate()
        ratios.append((found.squeeze - MODEL.squeeze) / found.squeeze_deviation)
    assert np.abs(ratios).max() < 3.0
    assert 0.3 < np.sqrt(np.mean(np.square(ratios))) < 1.5


def test_the_deviation_of_the_squeeze_contains_that_of_the_stiffness():
    exact, found = (start(stiffness=stiffness).estimate() for stiffness in (0.0, 0.3))
    expected = math.hypot(exact.squeeze_deviation, 0.3 * found.squeeze)
    assert found.squeeze_deviation == pytest.approx(expected)


def test_calibrations_of_the_robot_file_state_the_deviations_of_stiffness_and_offsets():
    zeros = {'south/P': 1e-3, 'south/Q': 2e-3}
    calibration = {'stiffness_deviation': 0.02, 'zero_deviations': zeros}
    known = replace(CONFIG.robot.description, calibration=calibration)
    found = EstimatorSettings().calibrated(known)
    assert (found.stiffness, found.zero_deviation) == (0.02, 2e-3)
    assert EstimatorSettings().calibrated(known, 0.005).zero_deviation == 0.005
    assert EstimatorSettings().calibrated(replace(known, calibration={})) == EstimatorSettings()


@pytest.mark.parametrize('shifts', [(-2.7e-3, -2.9e-3), (-2e-3, -2e-3)])
def test_a_box_tilted_off_its_face_has_the_squeeze_of_its_contacts(shifts):
    x, y = 0.093, 0.111
    box = Polygon([(-x, -y), (x, -y), (x, y), (-x, y)], corner_radius=0.02)
    home, members = make_robot().home, ('north/Z-R', 'north/P-Z')
    grip = Grip(members, place_between(home, members, box, 0.995, 0.01).body, 0.8)
    tilted = attach_model(home, grip)
    for _ in range(4):
        moved = 0.25 * np.array(shifts)[tilted.contacts.owners]
        tilted = roll_grip(tilted.with_anchors(tilted.anchors + moved), home)
    found = start(grip=grip, config=home, pose=tilted.pose).estimate()
    assert found.squeeze == pytest.approx(tilted.squeeze, rel=0.01)


@pytest.mark.parametrize(
    ('direction', 'least', 'most'),
    [
        ((1.0, 0.0, 0.0), 0.009, 0.015),
        ((0.0, 1.0, 0.0), 0.0045, 0.007),
        ((0.0, 0.0, 1.0), 0.0025, 0.007),
    ],
)
def test_drift_at_rest_is_a_slip_if_load_and_model_error_do_not_explain_it(direction, least, most):
    settings, control = SqueezeSettings(0.0, **MASSLESS | {'load': 0.5}), SqueezeControl()
    start, sample = GRIP.moved_to(MODEL.pose), (StampedInput(MODEL.pose, 0.0), 0.0)
    control, _ = control.followed(settings, CONFIG, start, 0.0, sample)
    away = np.array(direction) / ARM
    for k in range(120):
        moved = max(0.02 * k - 0.4, 0.0) * 0.01
        sample = StampedInput(Pose(*MODEL.pose + moved * away), 0.02 * (k + 1)), 0.0
        control, _ = control.followed(settings, CONFIG, start, 0.02, sample)
        if control.fault is not None:
            break
    assert control.fault is Status.HALT_SLIPPED
    assert least < moved < most


BELIEF = GripBelief.of(MODEL, GRIP.moved_to(MODEL.pose), EstimatorSettings())
#: Roller speeds [m/s].
FAST = np.array([16e-3, -10e-3, 8e-3, -12e-3, 6e-3, -14e-3])


def follow(belief, time, period, pressures=None):
    """Return the belief after motion that has lasted for a time [s]."""
    config = CONFIG.moved_to(CONFIG.roller_positions + time * FAST)
    belief, hold = belief.followed(config, period, pressures)
    assert hold is HoldStatus.HELD
    return belief


def check_errors(belief, held):
    """Check the errors of pose and squeeze relative to an equilibrium."""
    *errors, squeeze_error = pose_difference(
        belief.outputs, np.append(held.pose, held.squeeze)
    ) * (1.0, 1.0, held.arm, 1.0)
    assert np.linalg.norm(errors) < MAX_ERRORS[0]
    assert abs(squeeze_error) < MAX_ERRORS[1]


@pytest.mark.parametrize('period', [0.01, 0.05])
def test_predicted_pose_squeeze_and_slip_margin_are_within_the_bounds_of_their_errors(period):
    belief, held = BELIEF, MODEL
    for number in range(1, round(0.5 / period) + 1):
        belief = follow(belief, number * period, period)
        config = CONFIG.moved_to(CONFIG.roller_positions + number * period * FAST)
        held = roll_grip(held, config)
        check_errors(belief, held)
        assert belief.slip_margin == pytest.approx(held.slip_margin(GRIP.friction), abs=0.2)


def test_a_short_motion_needs_no_equilibrium():
    belief = BELIEF
    for number in range(1, 6):
        belief = follow(belief, 1e-3 * number, 0.01)
    assert belief.held is BELIEF.held


def follow_to_equilibrium():
    """Return the beliefs of all cycles at constant speed until the next equilibrium."""
    beliefs = [BELIEF]
    while beliefs[-1].held is BELIEF.held:
        beliefs.append(follow(beliefs[-1], 0.01 * len(beliefs), 0.01))
    return beliefs


@pytest.mark.parametrize('turned', [-FAST, FAST[::-1], 0.1 * FAST])
def test_a_motion_may_turn_after_the_first_step_to_an_equilibrium(turned):
    *_, belief, _ = beliefs = follow_to_equilibrium()
    assert belief.cache.begun is not None
    start = CONFIG.roller_positions + 0.01 * (len(beliefs) - 2) * FAST
    held = belief.held
    for number in range(1, 50):
        config = CONFIG.moved_to(start + 0.01 * number * turned)
        belief, _ = belief.followed(config, 0.01, None)
        held = roll_grip(held, config)
        check_errors(belief, held)
    assert belief.held is not beliefs[0].held


def test_an_equilibrium_is_complete_at_once_in_the_cycle_after_another_one():
    pressures = [tuple(factor * np.array(MODEL.pressures)) for factor in (1.05, 1.1)]
    belief = follow(follow(BELIEF, 0.0, 0.01, pressures[0]), 0.0, 0.01, pressures[1])
    assert belief.held.pressures == pressures[1]
    assert belief.cache.usage.used == pytest.approx(belief.held.sections.used.max())


def test_other_pressures_and_offsets_need_an_equilibrium_at_once():
    pressures = tuple(1.05 * np.array(MODEL.pressures))
    assert follow(BELIEF, 0.0, 0.01, pressures).held.pressures == pressures
    corrected = BELIEF.with_zeros_corrected(1e-4 * np.ones(6))
    assert follow(corrected, 0.0, 0.01).held is not BELIEF.held


def is_next_due(cache, margin):
    """Return whether the next equilibrium is due at a slip margin [N]."""
    return np.linalg.norm(cache.travel) > cache.travel_limit(None, margin)


def test_travel_that_may_close_a_gap_needs_an_equilibrium():
    moved = CONFIG.moved_to(CONFIG.roller_positions + 0.02 * FAST)
    cache = BELIEF.cache.predict(moved, 0.01)
    assert not is_next_due(cache, BELIEF.slip_margin)
    with_gap = replace(cache, grip=replace(cache.grip, gaps=(CornerGap(0, 0, 1e-3),)))
    assert is_next_due(with_gap, BELIEF.slip_margin)


def test_each_motion_near_slip_needs_an_equilibrium():
    moved = CONFIG.moved_to(CONFIG.roller_positions + 1e-3 * FAST)
    cache = BELIEF.cache.predict(moved, 0.01)
    assert is_next_due(cache, 0.01 * MODEL.squeeze)
    assert not is_next_due(BELIEF.cache, 0.01 * MODEL.squeeze)


def test_utilisation_is_that_of_the_equilibrium_while_offsets_are_corrected():
    belief, rng = BELIEF, np.random.default_rng(0)
    for number in range(1, 100):
        if number > 50:  # the gradients have been learned
            belief = belief.with_zeros_corrected(rng.normal(0.0, 1e-6, 6))
        belief = follow(belief, 0.01 * number, 0.01)
    assert belief.cache.usage.used == pytest.approx(belief.held.sections.used.max())


def test_a_search_finds_the_equilibrium_from_which_a_load_displaces_the_object():
    load = np.array([1.5, -1.0, 0.2])
    shift = MODEL.response.pose @ load
    poses = BELIEF.rolled_poses
    poses = replace(poses, at_equilibrium=poses.at_equilibrium + shift)
    state = replace(BELIEF.state, load=load)
    due = replace(BELIEF, state=state, rolled_poses=poses, search_due=HoldStatus.NO_BALANCE)
    belief = follow(due, 0.0, 0.01)
    assert belief.held is not MODEL
    assert belief.held.pose == pytest.approx(MODEL.pose, abs=1e-4)


def test_offsets_and_loads_explain_a_displacement_of_some_deviations_only():
    explains, cache = BELIEF.state.explains, BELIEF.cache
    by_offset = cache.by_offsets.outputs[:3, 0] * EstimatorSettings().zero_deviation
    by_load = MODEL.response.pose[:, 0] * EstimatorSettings().load
    for displacement in (by_offset, by_load):
        assert explains(MODEL.pose + 2.0 * displacement, cache)
        assert not explains(MODEL.pose + 0.5 * displacement / np.linalg.norm(displacement), cache)


#: Line along which unknowns are quadratic.
LINE = np.array([0.6, 0.0, -0.8])
RATES, CURVATURE = np.array([[1.0, 2.0, 0.5], [-3.0, 0.4, 7.0]]), np.array([20.0, -900.0])


def at(travel):
    """Return the unknowns after a travel."""
    along = LINE @ travel
    return RATES @ travel + 0.5 * along**2 * CURVATURE


def rates_at(travel):
    """Return the derivatives of the unknowns after a travel."""
    return RATES + LINE @ travel * np.outer(CURVATURE, LINE)


def continued(*lengths):
    """Return the prediction after travels along the line from exact rates, and the place."""
    prediction, place = TravelPrediction.of(RATES), np.zeros(3)
    for length in lengths:
        travel = length * LINE
        prediction = prediction.continued(travel, at(place + travel) - at(place))
        place = place + travel
    return prediction, place


@pytest.mark.parametrize('lengths', [(3e-3,), (3e-3, 5e-3), (4e-3, 1e-3, 2e-3)])
def test_secants_give_the_curvature_along_a_line(lengths):
    prediction, place = continued(*lengths)
    for further in (4e-3 * LINE, -2e-3 * LINE):
        expected = at(place + further) - at(place)
        np.testing.assert_allclose(prediction.change(further), expected, rtol=1e-9)


def test_a_turn_back_has_the_secant_as_rates():
    prediction, place = continued(3e-3, -2e-3)
    np.testing.assert_allclose(prediction.change(2e-3 * LINE), at(place + 2e-3 * LINE) - at(place))


def test_exact_rates_keep_the_curvature():
    prediction, place = continued(3e-3, 2e-3)
    prediction, further = prediction.with_rates(rates_at(place)), 5e-3 * LINE
    np.testing.assert_allclose(prediction.change(further), at(place + further) - at(place))


def test_errors_of_a_short_travel_do_not_change_the_rates():
    prediction, place = continued(3e-3, 2e-3)
    travel, further = 1e-5 * LINE, 4e-3 * LINE
    wrong = at(place + travel) - at(place) + 1e-7
    prediction, place = prediction.continued(travel, wrong), place + travel
    np.testing.assert_allclose(prediction.change(further), at(place + further) - at(place))
