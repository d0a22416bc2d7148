# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a measurement does to the covariance of a state, against other ways to compute it."""

from isotruss_ros.core.estimation.two_stage_filter import condition, TwoStageFilter
import numpy as np
import pytest
import scipy

RNG = np.random.default_rng(0)
#: Bounds and sizes of the factors of decay, and of the variances of state and parameters by noise.
PARTS = ((0.5, 1.0, 3), (0.0, 0.1, 3), (0.0, 1.0, 2))


def drawn(size, count):
    """Return a random prior covariance, rates and noise."""
    spread = RNG.normal(size=(size, size))
    noise = np.diag(RNG.uniform(0.1, 1.0, count))
    return spread @ spread.T + np.eye(size), RNG.normal(size=(count, size)), noise


def test_a_linear_update_is_least_squares():
    (prior, rates, noise), measured = drawn(5, 8), RNG.normal(size=8)
    gain, _, covariance = condition(prior, rates, noise)
    root = np.linalg.cholesky(np.linalg.inv(prior)).T
    rows = np.vstack([root, rates / np.sqrt(np.diag(noise))[:, None]])
    right = np.concatenate([np.zeros(5), measured / np.sqrt(np.diag(noise))])
    assert gain @ measured == pytest.approx(scipy.linalg.lstsq(rows, right)[0])
    assert covariance == pytest.approx(np.linalg.inv(rows.T @ rows))


def test_considered_parameters_increase_the_covariance_of_functions_of_the_state():
    prior, rates, noise = drawn(4, 6)
    variances, by_offsets = np.diag(prior), RNG.normal(size=(6, 2))
    known = TwoStageFilter(variances, np.zeros((2, 2)))
    unknown = TwoStageFilter(variances, np.eye(2))
    for each in (known, unknown):
        each.condition(rates, by_offsets, noise)
    functions, none = RNG.normal(size=(3, 4)), np.zeros((3, 2))
    more = unknown.spread(functions, none) - known.spread(functions, none)
    errors = functions @ condition(np.diag(variances), rates, noise)[0] @ by_offsets
    assert more == pytest.approx(errors @ errors.T)


def test_both_stages_are_the_kalman_filter_of_state_and_drifting_parameters():
    prior, _, _ = drawn(3, 2)
    variances, truth = np.diag(prior), RNG.normal(size=2)
    two, state = TwoStageFilter(variances, np.diag([2.0, 3.0])), np.zeros(3)
    whole, mean = np.diag([*variances, 2.0, 3.0]), np.zeros(5)
    for _ in range(6):
        decay, more, drift = (RNG.uniform(*part) for part in PARTS)
        state = decay * state + two.predict(decay, more, drift)
        both = np.append(decay, [1.0, 1.0])
        whole = whole * np.outer(both, both) + np.diag([*more, *drift])
        mean = both * mean
        (_, rates, noise), by_parameters = drawn(3, 2), RNG.normal(size=(2, 2))
        measured = by_parameters @ truth + RNG.normal(size=2)
        off = measured - rates @ state
        state = state + two.condition(rates, by_parameters, noise, off) @ off
        every = np.hstack([rates, by_parameters])
        gain, _, whole = condition(whole, every, noise)
        mean = mean + gain @ (measured - every @ mean)
    assert two.parameters == pytest.approx(mean[3:])
    assert two.posterior == pytest.approx(whole[3:, 3:])
    assert state + two.sensitivity @ two.parameters == pytest.approx(mean[:3])
    functions = RNG.normal(size=(4, 5))
    expected = functions @ whole @ functions.T
    assert two.spread(functions[:, :3], functions[:, 3:]) == pytest.approx(expected)


def test_replaced_components_have_their_prior_and_the_others_stay():
    (_, rates, noise), by_parameters = drawn(3, 4), RNG.normal(size=(4, 2))
    two = TwoStageFilter(np.ones(3), np.eye(2))
    two.condition(rates, by_parameters, noise)
    before, sensitivity = two.covariance, two.sensitivity
    two.resize(4, 2, 7.0)
    assert two.covariance == pytest.approx(scipy.linalg.block_diag(before[:2, :2], 7.0, 7.0))
    assert two.sensitivity == pytest.approx(np.vstack([sensitivity[:2], np.zeros((2, 2))]))


def test_a_known_change_of_the_parameters_keeps_their_sum():
    filters = [TwoStageFilter(np.ones(3), np.eye(2)) for _ in range(2)]
    (_, rates, noise), by_parameters = drawn(3, 4), RNG.normal(size=(4, 2))
    truth, known = RNG.normal(size=2), np.array([0.3, -0.2])
    for parameters, each in ((truth, filters[0]), (truth - known, filters[1])):
        each.condition(rates, by_parameters, noise, by_parameters @ parameters)
    filters[0].shift(known)
    assert filters[0].parameters == pytest.approx(filters[1].parameters)


def test_drift_of_the_parameters_increases_their_covariance_by_innovations():
    drifting, drift = TwoStageFilter(np.ones(2), 1e8 * np.eye(2)), np.array([0.5, 2.0])
    drifting.condition(np.zeros((2, 2)), np.eye(2), 3.0 * np.eye(2), np.array([1.0, -1.0]))
    drifting.predict(np.ones(2), np.zeros(2), drift)
    assert drifting.posterior == pytest.approx(np.diag(3.0 + drift), rel=1e-6)
    assert drifting.parameters == pytest.approx([1.0, -1.0], rel=1e-6)
