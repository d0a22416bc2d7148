# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Equilibria of a tracked grip, and the prediction by roller travel between them."""

from dataclasses import replace

from grips import gripped
from isotruss_ros.core import Grip
from isotruss_ros.core.estimation.equilibrium_cache import MAX_ERRORS
from isotruss_ros.core.estimation.grip_belief import GripBelief
from isotruss_ros.core.estimation.grip_model import attach_model
from isotruss_ros.core.estimation.state_estimate import EstimatorSettings
from isotruss_ros.core.estimation.travel_prediction import TravelPrediction
from isotruss_ros.core.holding.held_grip import HoldStatus
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.manipulation.grip import CornerGap
from isotruss_ros.core.model.pose import pose_difference
import numpy as np
import pytest

CONFIG, CYLINDER = gripped(35.0, squeeze=0.1)
GRIP = Grip.at_module(CONFIG.robot, 'north/Z', CYLINDER)
MODEL = attach_model(CONFIG, GRIP)
BELIEF = GripBelief.of(MODEL, GRIP.moved_to(MODEL.pose), EstimatorSettings())
#: Roller speeds [m/s].
SPEED = np.array([16e-3, -10e-3, 8e-3, -12e-3, 6e-3, -14e-3])


def follow(belief, time, period, pressures=None):
    """Return the belief after motion that has lasted for a time [s]."""
    config = CONFIG.moved_to(CONFIG.roller_positions + time * SPEED)
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
    for number in range(1, round(1.0 / period) + 1):
        belief = follow(belief, number * period, period)
        config = CONFIG.moved_to(CONFIG.roller_positions + number * period * SPEED)
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


@pytest.mark.parametrize('turned', [-SPEED, SPEED[::-1], 0.1 * SPEED])
def test_a_motion_may_turn_after_the_first_step_to_an_equilibrium(turned):
    *_, belief, _ = beliefs = follow_to_equilibrium()
    assert belief.cache.begun is not None
    start = CONFIG.roller_positions + 0.01 * (len(beliefs) - 2) * SPEED
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
    moved = CONFIG.moved_to(CONFIG.roller_positions + 0.02 * SPEED)
    cache = BELIEF.cache.predict(moved, 0.01)
    assert not is_next_due(cache, BELIEF.slip_margin)
    with_gap = replace(cache, grip=replace(cache.grip, gaps=(CornerGap(0, 0, 1e-3),)))
    assert is_next_due(with_gap, BELIEF.slip_margin)


def test_each_motion_near_slip_needs_an_equilibrium():
    moved = CONFIG.moved_to(CONFIG.roller_positions + 1e-3 * SPEED)
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
    lag = replace(BELIEF.lag, pose_at_equilibrium=BELIEF.lag.pose_at_equilibrium + shift)
    state = replace(BELIEF.state, load=load)
    due = replace(BELIEF, state=state, lag=lag, search_due=HoldStatus.NO_BALANCE)
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
