# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Prediction of unknowns by roller travel, for unknowns that are quadratic along a line."""

from isotruss_ros.core.estimation.travel_prediction import TravelPrediction
import numpy as np
import pytest

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
