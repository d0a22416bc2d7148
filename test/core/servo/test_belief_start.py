# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""First equilibrium of a grip: near the measured pose, or assumed with the desired squeeze."""

from dataclasses import replace

from held_grips import CORNER, HOME
from isotruss_ros.core import Disc, Grip, place_between, Polygon, Pose, Robot, Status
from isotruss_ros.core.estimation import state_estimate
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.inputs import RollerState, StampedInput
from nightly import some_now
import numpy as np
import pytest
from squeeze_loop import SqueezeLoop

BODY = place_between(HOME, CORNER, Disc(0.2), indentation=0.01).body
MODEL = attach_grip(HOME, BODY)
GRIP = Grip(CORNER, MODEL.body, 0.8)
OUTSIDE = [(0.0, -0.03, 0.0), (0.0, 0.03, 0.0)]
DEFAULTS = {'pose_gain': None, 'load': 0.0}
#: Poses of the object in the members' way, with both ends of a face up to 50 mm deep.
BOX = Polygon([(-0.055, -0.075), (0.055, -0.075), (0.055, 0.075), (-0.055, 0.075)], 0.02)
TURNED = Pose(0.66, 0.89, 1.55)


def at_rest(force=1.0, config=HOME, **settings):
    """Return a loop with a disc that stays in place, and a share of its squeeze as target."""
    options = DEFAULTS | settings
    grip = replace(GRIP) if config is HOME else Grip(CORNER, MODEL.body, 0.8)
    return SqueezeLoop(config, grip, force * MODEL.squeeze, follows=False, **options)


def start(loop, away, twist=(0.0, 0.0, 0.0), cycles=12):
    """Return the first decision with a squeeze, or the last of some cycles."""
    for _ in range(cycles):
        decision = loop.cycle(twist, away=away)
        if decision.squeeze is not None:
            break
    return decision


@pytest.mark.parametrize('away', some_now([(away,) for away in OUTSIDE]))
@pytest.mark.parametrize(
    ('zeros', 'gripped', 'held'), [(1e-2, True, True), (1e-2, False, False), (1e-3, True, False)]
)
def test_gripped_object_is_held_where_wrong_offsets_alone_explain_it(away, zeros, gripped, held):
    """A twist says that the object is gripped. The squeeze is the desired one, but unknown."""
    twist = (0.0, 0.0, 0.0) if gripped else None
    loop = at_rest(zero_deviation=zeros)
    decision = start(loop, away, twist, cycles=6)
    assert (decision.squeeze is not None) is held
    if not held:
        assert not decision.command.roller_velocities.any()
        return
    for _ in range(20):
        decision = loop.cycle(twist, away=away)
    squeeze, deviation = decision.squeeze
    assert squeeze == pytest.approx(MODEL.squeeze, rel=0.1)
    assert deviation >= squeeze
    assert 'close the grip further before carrying' in decision.message
    assert decision.command.status < Status.HALT_NO_TWIST


@pytest.mark.parametrize('force', some_now([1.3, 0.8, 2.0], 2))
def test_an_assumed_squeeze_is_within_two_model_errors_of_the_setting(force):
    loop = at_rest(force)
    error = 2.0 * state_estimate.EstimatorSettings().squeeze_error
    assert start(loop, OUTSIDE[0]).squeeze[0] == pytest.approx(loop.target, rel=error)


@pytest.mark.parametrize(('force', 'cycles'), some_now([(0.0, 6), (40.0, 12)]))
def test_no_equilibrium_is_assumed_for_a_squeeze_of_zero_or_beyond_wrong_offsets(force, cycles):
    """Offsets explain indentations of up to 40 mm."""
    decision = start(at_rest(force), OUTSIDE[0], cycles=cycles)
    assert decision.squeeze is None
    assert decision.command.status is Status.HALT_NOT_HELD


def test_an_equilibrium_far_beyond_wrinkling_starts_no_belief():
    decision = at_rest().cycle(None, away=(0.0, 0.025, 0.0))
    assert decision.squeeze is None
    decision = at_rest().cycle(away=(0.0, 0.025, 0.0))
    assert 'wrinkle' in decision.message


def test_an_assumed_equilibrium_is_at_the_measured_angle():
    placed = place_between(HOME, CORNER, BOX, 0.0).body
    grip = Grip(CORNER, attach_grip(HOME, placed).body, 0.8)
    loop = SqueezeLoop(HOME, grip, MODEL.squeeze, follows=False, **DEFAULTS)
    for number in range(12):
        decision = loop.cycle(pose=StampedInput(TURNED, loop.now))
        if decision.squeeze is not None:
            break
        assert number > 0 or decision.command.status is Status.HALT_NOT_HELD
    assert decision.desired_pose.angle == pytest.approx(TURNED.angle, abs=0.02)


def test_no_equilibrium_is_assumed_after_a_fault():
    loop = at_rest()
    loop.cycle()
    loop.cycle(away=(0.0, 0.1, 0.0))
    assert loop.statuses[-1] is Status.HALT_NOT_HELD
    loop.servo.receive(halt=(Status.HALT_KINEMATICS, 'singular'))
    for _ in range(6):
        loop.cycle()
    loop.servo.receive(halt=None)
    assert start(loop, OUTSIDE[0], cycles=4).squeeze is None


@pytest.mark.parametrize('away', some_now([(away,) for away in OUTSIDE]))
@pytest.mark.parametrize('direction', some_now([((1.0, 0.0),), ((0.0, 1.0),), ((0.0, -1.0),)]))
@pytest.mark.parametrize('speed', some_now([0.03, 0.005]))
def test_an_object_that_does_not_follow_is_reported_within_20_mm(away, direction, speed):
    loop = at_rest()
    loop.follows = True
    lying = Pose(*np.add(loop.plant.object_pose, away))
    twist = speed * np.array([*direction, 0.0])
    for _ in range(round(0.02 / speed / loop.period)):
        # The noise is far below that of trackers: equal poses are an own fault.
        pose = Pose(*np.array(lying) + 1e-9 * loop.rng.standard_normal(3))
        decision = loop.cycle(twist, pose=StampedInput(pose, loop.now))
        if 'next step' in decision.message:
            break
    assert decision.command.status in (Status.HALT_SLIPPED, Status.HALT_NOT_HELD)


@pytest.mark.parametrize('deviation', [None, 5e-3])
def test_the_offsets_have_the_deviation_of_the_robot_file_unless_it_is_set(deviation):
    zeros = dict.fromkeys(HOME.robot.roller_names, 2e-3)
    known = Robot(replace(HOME.robot.description, calibration={'zero_deviations': zeros})).home
    calibrated = at_rest(config=known, zero_deviation=deviation).cycle().squeeze
    expected = at_rest(zero_deviation=deviation or 2e-3).cycle().squeeze
    assert calibrated == pytest.approx(expected, rel=1e-6)
    assert calibrated[1] < 0.9 * at_rest().cycle().squeeze[1]


def test_a_load_of_zero_stands_for_that_of_the_estimator():
    prior = state_estimate.EstimatorSettings().load
    squeezes = [at_rest(load=load).cycle().squeeze for load in (0.0, prior, 3.0 * prior)]
    assert squeezes[0] == squeezes[1]
    assert squeezes[2] != squeezes[0]


def test_corrected_offsets_end_an_assumed_squeeze():
    """The estimate of the offsets was wrong by 40 mm of opening."""
    loop, spread = at_rest(), np.eye(6)
    positions = loop.plant.roller_positions
    closing = SqueezeLoop(HOME, GRIP, 2.0 * MODEL.squeeze).cycle().command.roller_velocities
    opening = -0.04 * closing / np.abs(closing).max()
    for offsets, deviation, cycles in ((opening, 0.01, 10), (np.zeros(6), 1e-3, 4)):
        for _ in range(cycles):
            state = RollerState(positions + offsets, np.zeros(6), offsets)
            estimate = state_estimate.EstimatedTravel(offsets, deviation**2 * spread)
            measured, known = StampedInput(state, loop.now), StampedInput(estimate, loop.now)
            decision = loop.cycle(rollers=measured, estimate=known)
        assert state_estimate.is_squeeze_known(*decision.squeeze) is (deviation < 5e-3)
    assert decision.squeeze[0] == pytest.approx(MODEL.squeeze, rel=0.1)
