# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Friction as an interval of measured coefficients: chance, files, and verdicts."""

from dataclasses import fields

from grips import gripped
from isotruss_ros.core import settle_grasp, Uncertainty
from isotruss_ros.core.errors import GraspError
import pytest
import robots

CONFIG, DISC = gripped(40.0, squeeze=0.04)
SETTLED = settle_grasp(CONFIG, DISC, 0.9)
REQUIRED = SETTLED.required_friction
ONLY_FRICTION = {
    field.name: 0.0
    for field in fields(Uncertainty)
    if field.name not in ('friction', 'offset_covariance')
}


def uncertain(smallest, largest):
    """Return an uncertainty of friction alone."""
    return Uncertainty(friction=(smallest, largest), **ONLY_FRICTION)


@pytest.mark.parametrize(
    ('below', 'above', 'share'),
    [(-0.2, -0.1, 0.0), (-0.2, 0.1, 1.0 / 3.0), (0.1, 0.2, 1.0), (0.1, 0.1, 1.0)],
)
def test_chance_from_samples_is_the_share_of_the_interval_above_the_required_friction(
    below, above, share
):
    uncertainty = uncertain(REQUIRED + below, REQUIRED + above)
    assert SETTLED.chance(uncertainty, samples=4).probability == pytest.approx(share, abs=1e-4)


def test_chance_to_first_order_has_the_mean_and_variance_of_the_interval():
    half_width = 3.0**0.5 * 0.05  # of a uniform distribution with a standard deviation of 0.05
    interval = uncertain(0.5 - half_width, 0.5 + half_width)
    normal = Uncertainty(friction=0.05, **ONLY_FRICTION)
    expected = settle_grasp(CONFIG, DISC, 0.5).chance(normal, samples=0)
    assert SETTLED.chance(interval, samples=0).probability == pytest.approx(expected.probability)


def test_robot_file_states_the_interval_as_a_list():
    document = robots.preset_document('nine_member') | {'uncertainty': {'friction': [0.5, 0.8]}}
    assert Uncertainty.of(robots.load(document)).friction == (0.5, 0.8)


@pytest.mark.parametrize(
    ('friction', 'words'),
    [
        ((0.8, 0.5), 'the smallest coefficient, then'),
        ((0.5,), 'smallest and largest'),
        ((0, 11), '10'),
    ],
)
def test_interval_with_wrong_values_is_refused(friction, words):
    with pytest.raises(GraspError, match=words):
        Uncertainty(friction=friction)


@pytest.mark.parametrize(
    ('interval', 'verdict'),
    [((-0.2, -0.01), 'lost'), ((-0.2, 0.1), 'unknown'), ((0.01, 0.1), 'held')],
)
def test_verdict_of_an_interval_holds_for_all_of_its_coefficients(interval, verdict):
    smallest, largest = interval
    friction = REQUIRED + smallest, REQUIRED + largest
    assert SETTLED.friction_range.verdict(friction) == verdict
