# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Start of the belief of an object outside of the grip, and its end without an object."""

from dataclasses import replace
from functools import cache, partial

from held_grips import HOME
from isotruss_ros.core import (
    Disc,
    Grip,
    HoldStatus,
    place_between,
    Polygon,
    Pose,
    Robot,
    solve_twist,
    Status,
)
from isotruss_ros.core.estimation.state_estimate import EstimatorSettings, is_squeeze_known
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.held_grip import NotHeldError
from isotruss_ros.core.servo import belief_start
from isotruss_ros.core.servo.belief_start import BeliefStart
from isotruss_ros.core.servo.servo_settings import SqueezeSettings
from isotruss_ros.core.servo.squeeze_control import SqueezeControl
from nightly import some_now
import numpy as np
import pytest

MEMBERS = ('north/P-Z', 'north/Z-R')
BODY = place_between(HOME, MEMBERS, Disc(0.2), indentation=0.01).body
MODEL = attach_grip(HOME, BODY)
SETTINGS = SqueezeSettings(MODEL.squeeze)
OUTSIDE = [np.array([0.0, -0.03]), np.array([0.0, 0.03])]
PERIOD = 0.02
BOX = Polygon([(-0.055, -0.075), (0.055, -0.075), (0.055, 0.075), (-0.055, 0.075)], 0.02)
# Both ends of a face penetrate a straight tube, by up to 50 mm.
TURNED = Grip(MEMBERS, place_between(HOME, MEMBERS, BOX, 0.0).body, 0.8).moved_to(
    (0.66, 0.89, 1.55)
)


def measured(away):
    """Return the grip with the object at a distance from its equilibrium."""
    x, y, angle = MODEL.pose
    return Grip(MEMBERS, BODY.moved_to(Pose(x + away[0], y + away[1], angle)), 0.8)


def search(start, grip, settings=SETTINGS, gripped=True, config=HOME):
    """Return the hold status after one search, and the belief or None."""
    try:
        return HoldStatus.HELD, start.search(config, grip, settings, gripped, None, None)
    except NotHeldError as error:
        return error.hold, None


def started_belief(start, grip, settings=SETTINGS):
    """Return the belief after at most twelve searches, or None."""
    beliefs = (search(start, grip, settings)[1] for _ in range(12))
    return next(filter(None, beliefs), None)


def _solve(config, grip, twist, rate):
    return solve_twist(config, grip, twist, opening_rate=rate)


@pytest.mark.parametrize('away', some_now(OUTSIDE))
def test_only_an_object_commanded_as_gripped_has_a_supposed_equilibrium(away):
    start = BeliefStart()
    for _ in range(6):
        assert search(start, measured(away), gripped=False)[0] is not HoldStatus.HELD


@pytest.mark.parametrize(('deviation', 'is_held'), [(1e-2, True), (1e-3, False)])
def test_an_equilibrium_is_assumed_only_if_wrong_offsets_explain_the_pose(deviation, is_held):
    settings = replace(SETTINGS, zero_deviation=deviation)
    belief = started_belief(BeliefStart(), measured(OUTSIDE[0]), settings)
    assert (belief is not None) is is_held


def test_an_equilibrium_far_beyond_wrinkling_starts_no_belief():
    start = BeliefStart()
    grip = measured((0.0, 0.025))
    assert search(start, grip, gripped=False)[0] is HoldStatus.WRINKLES


def test_an_unexplained_equilibrium_starts_no_belief_but_one_at_the_measured_angle():
    start = BeliefStart()
    assert search(start, TURNED)[0] is HoldStatus.FAR
    assert started_belief(start, TURNED).pose[2] == pytest.approx(TURNED.body.pose.angle, abs=0.02)


def test_the_assumed_object_is_at_most_four_deviations_of_the_offsets_deep(monkeypatch):
    depths = []

    def place(*given):
        depths.append(given[4])
        return place_between(*given)

    monkeypatch.setattr(belief_start, 'place_between', place)
    start, wanted = BeliefStart(), replace(SETTINGS, force=1e3)
    assert started_belief(start, measured(OUTSIDE[0]), wanted) is None
    assert depths[0] == 0.01
    assert depths[-1] == max(depths) == 0.04


def test_no_equilibrium_is_assumed_after_a_fault():
    control = SqueezeControl(SETTINGS)
    control.fail(Status.HALT_SLIPPED, 'it was drawn')
    for _ in range(8):
        control.follow(HOME, measured(OUTSIDE[0]), PERIOD, gripped=True)
    assert control.belief is None


@pytest.mark.parametrize('away', some_now(OUTSIDE))
@pytest.mark.parametrize('direction', some_now([((1.0, 0.0),), ((0.0, 1.0),), ((0.0, -1.0),)]))
@pytest.mark.parametrize('speed', some_now([0.03, 0.005]))
def test_an_object_that_does_not_follow_is_reported_within_20_mm(away, direction, speed):
    control, config, path = SqueezeControl(SETTINGS), HOME, 0.0
    lying, twist = measured(away), speed * np.array([*direction, 0.0])
    while control.fault is None:
        assert path <= 0.02
        hold = control.follow(config, lying, PERIOD, gripped=True)
        path += speed * PERIOD
        if hold is not HoldStatus.HELD:
            continue
        solve = partial(_solve, config, control.belief.cache.grip)
        command = control.solve(twist, PERIOD, solve)
        control.advance(twist, command)
        config = config.moved_to(config.roller_positions + PERIOD * command.roller_velocities)


@pytest.mark.parametrize(('given', 'used'), [(None, 2e-3), (0.005, 0.005)])
def test_the_offsets_have_the_deviation_of_the_robot_file_unless_it_is_set(given, used):
    zeros = dict.fromkeys(HOME.robot.roller_names, 2e-3)
    known = replace(HOME.robot.description, calibration={'zero_deviations': zeros})
    settings, start = replace(SETTINGS, zero_deviation=given), BeliefStart()
    _, belief = search(start, measured((0.0, 0.0)), settings, config=Robot(known).home)
    assert belief.settings.zero_deviation == used


@pytest.mark.parametrize(('given', 'used'), [(0.0, EstimatorSettings().load), (5.0, 5.0)])
def test_a_load_of_zero_stands_for_that_of_the_estimator(given, used):
    start = BeliefStart()
    _, belief = search(start, measured((0.0, 0.0)), replace(SETTINGS, load=given))
    assert belief.settings.load == used


@pytest.mark.parametrize('force', some_now([2.0, 0.8, 1.3], 2))
def test_an_assumed_squeeze_is_within_two_model_errors_of_the_setting(force):
    start, wanted = BeliefStart(), replace(SETTINGS, force=force * SETTINGS.force)
    belief = started_belief(start, measured(OUTSIDE[0]), wanted)
    error = 2.0 * EstimatorSettings().squeeze_error
    assert belief.squeeze == pytest.approx(wanted.force, rel=error)


def test_no_equilibrium_is_assumed_for_a_squeeze_of_zero():
    start, wanted = BeliefStart(), replace(SETTINGS, force=0.0)
    assert started_belief(start, measured(OUTSIDE[0]), wanted) is None


@cache
def started(x, y):
    """Return a control after an assumed start, with the object at rest."""
    control, grip = SqueezeControl(SETTINGS), measured((x, y))
    for _ in range(25):
        control.follow(HOME, grip, PERIOD, gripped=True)
    return control


@pytest.mark.parametrize('away', some_now(OUTSIDE[::-1]))
def test_an_assumed_squeeze_is_unknown_and_stays_as_assumed(away):
    control = started(*away)
    squeeze, deviation = control.belief.squeeze, control.belief.squeeze_deviation
    assert control.belief.is_assumed
    assert squeeze == pytest.approx(SETTINGS.force, rel=0.1)
    assert deviation >= squeeze
    assert 'close the grip further before carrying' in control.note((squeeze, deviation))


@pytest.mark.parametrize('away', some_now(OUTSIDE[::-1]))
def test_an_assumed_start_at_rest_is_no_slip(away):
    control = started(*away)
    assert control.belief.is_assumed
    assert control.fault is None


def test_corrected_offsets_end_an_assumed_squeeze():
    command = solve_twist(HOME, measured((0.0, 0.0)), np.zeros(3), opening_rate=0.02)
    opening = 2.0 * command.roller_velocities
    control, grip = SqueezeControl(SETTINGS), measured((0.0, 0.0))
    config, covariance = HOME.moved_to(HOME.roller_positions + opening), np.eye(6)
    control.take_offsets(opening, 0.01**2 * covariance, 0.0)
    for _ in range(10):
        control.follow(config, grip, PERIOD, gripped=True)
    assert control.belief.is_assumed
    control.take_offsets(np.zeros(6), 1e-3**2 * covariance, 1.0)
    for _ in range(2):  # the equilibrium is searched in the second cycle
        control.follow(HOME, grip, PERIOD, gripped=True)
    assert control.belief.squeeze == pytest.approx(MODEL.squeeze, rel=0.1)
    assert is_squeeze_known(control.belief.squeeze, control.belief.squeeze_deviation)
