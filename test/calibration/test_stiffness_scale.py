# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stiffness, rollers and oscillations from measured motions of joints and objects."""

from dataclasses import replace
import re

from carries import make_robot
from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.calibration.oscillation import fit_oscillation
from isotruss_ros.calibration.roller_check import judge_roller
from isotruss_ros.calibration.stiffness_scale import calibrate_stiffness
from isotruss_ros.core import deform, Robot
import numpy as np
import pytest

ROBOT = make_robot()
NAMES, PULL = ROBOT.topology.joint_names, {'Z': (10.0, 0.0)}
SMALL = {joint: 1e-3 * np.array(force) for joint, force in PULL.items()}
NOISE, ROLLERS = 1e-3, ROBOT.roller_names
TIMES, ARM = np.arange(0.0, 3.0, 0.01), 0.15


def joints(nodes, noise=0.0, seed=0):
    rng = np.random.default_rng(seed)
    return {
        name: tuple(place + noise * rng.normal(size=2))
        for name, place in zip(NAMES, nodes, strict=False)
    }


def pulled(scale, pull=PULL):
    """Return the joints of a robot so many times as stiff as its model, under a pull."""
    loaded = deform(ROBOT.home, {joint: np.array(force) / scale for joint, force in pull.items()})
    nodes = ROBOT.home.nodes[: len(NAMES)]
    return joints(nodes + [loaded.displacement(name)[:2] for name in NAMES])


@pytest.mark.parametrize('filed', [1.0, 0.8])
@pytest.mark.parametrize('scale', [0.3, 1.0, 1.5])
def test_fitted_scale_agrees_with_the_true_one_for_any_scale_of_the_file(scale, filed):
    home = Robot(replace(ROBOT.description, stiffness_scale=filed)).home
    result = calibrate_stiffness(home, PULL, joints(home.nodes), pulled(scale), 1e-4)
    assert result.scale == pytest.approx(scale, rel=1e-4)


def test_deviation_of_the_scale_is_that_of_noisy_markers():
    nodes, loaded = ROBOT.home.nodes, [*pulled(1.0).values()]
    errors = []
    for seed in range(0, 80, 2):
        before, under = joints(nodes, 1e-4, seed), joints(loaded, 1e-4, seed + 1)
        result = calibrate_stiffness(ROBOT.home, PULL, before, under, 1e-4)
        errors.append((result.scale - 1.0) / result.deviation)
    assert 0.75 < np.sqrt(np.mean(np.square(errors))) < 1.25


@pytest.mark.parametrize(
    ('pull', 'displaced', 'deviation', 'words'),
    [
        (SMALL, pulled(1.0), 1e-5, r'stiffness 0\.001 times .* is the pull in N'),
        (PULL, pulled(60.0), 1e-3, 'too small; pull harder'),
        (PULL, pulled(1.0) | {'P': (0.05, 0.0)}, 1e-3, 'joint P: moved .* off what one scale'),
    ],
    ids=['pull in kN', 'too small a force', 'inconsistent displacement'],
)
def test_displacements_that_no_scale_explains_are_refused(pull, displaced, deviation, words):
    with pytest.raises(MeasurementError, match=words):
        calibrate_stiffness(ROBOT.home, pull, joints(ROBOT.home.nodes), displaced, deviation)


def turn(roller, travel, joints=('P', 'R', 'Z'), seed=0):
    """Return how joints are measured to move with a roller."""
    positions = np.zeros(len(ROLLERS))
    positions[ROLLERS.index(roller)] = travel
    moved = ROBOT.configuration(positions).nodes - ROBOT.home.nodes
    moved = moved + NOISE * np.random.default_rng(seed).normal(size=moved.shape)
    return {name: tuple(moved[NAMES.index(name)]) for name in joints}


@pytest.mark.parametrize('roller', ROLLERS)
def test_three_joints_distinguish_every_roller(roller):
    assert judge_roller(ROBOT.home, roller, 0.02, turn(roller, 0.02), NOISE) == ''


@pytest.mark.parametrize('roller', ROLLERS)
@pytest.mark.parametrize(
    ('travel', 'words'),
    [
        (-0.02, 'turned the other way'),
        (0.03, r'turned by \+(2[7-9]|3[0-3])\..* in place of \+20'),
        (0.0, 'no meas'),
    ],
)
def test_a_wrong_sign_or_scale_is_named(roller, travel, words):
    assert re.search(words, judge_roller(ROBOT.home, roller, 0.02, turn(roller, travel), NOISE))


def test_rollers_that_are_swapped_are_named():
    result = judge_roller(ROBOT.home, 'south/P', 0.02, turn('east/Q', 0.02), NOISE)
    assert result.startswith('east/Q turned in its place')


def test_a_motion_that_no_single_roller_causes_is_reported():
    moved = {'P': (0.05, 0.0), 'R': (-0.05, 0.0), 'Z': (0.0, 0.05)}
    reported = [judge_roller(ROBOT.home, roller, 0.02, moved, NOISE) for roller in ROLLERS]
    assert any('no single roller explains' in sentence for sentence in reported)


def test_a_check_without_joints_is_refused():
    with pytest.raises(MeasurementError, match='no joint was measured: must be some of P, Q'):
        judge_roller(ROBOT.home, 'south/P', 0.02, {}, NOISE)


def swing(frequency, damping, noise=0.0):
    """Return the poses of an oscillation of 6 mm along a line that turns as well."""
    rng = np.random.default_rng(3)
    decay, damped = damping * frequency, frequency * np.sqrt(1.0 - damping**2)
    along = 0.006 * np.exp(-decay * TIMES) * np.cos(damped * TIMES + 0.4)
    poses = np.array((0.7, 0.4, 0.2)) + np.outer(along, (0.8, -0.6, 1.0))
    return poses + noise * rng.normal(size=poses.shape) / (1.0, 1.0, ARM)


@pytest.mark.parametrize('damping', [0.02, 0.1, 0.5])
@pytest.mark.parametrize('frequency', [2.5, 9.0, 23.0])
def test_fit_of_an_exact_oscillation_is_exact(frequency, damping):
    result = fit_oscillation(TIMES, swing(frequency, damping), ARM)
    assert result[:2] == pytest.approx((frequency, damping), rel=1e-6)


def test_fit_with_noise_of_one_millimetre_is_within_its_tolerance():
    result = fit_oscillation(TIMES, swing(9.0, 0.1, 0.001), ARM)
    assert result.frequency == pytest.approx(9.0, rel=0.02)
    assert result.damping_ratio == pytest.approx(0.1, rel=0.2)


def test_a_creeping_motion_is_no_oscillation():
    with pytest.raises(MeasurementError, match='not one damped oscillation'):
        fit_oscillation(TIMES, np.outer(TIMES, (0.01, 0.0, 0.0)), ARM)
