# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Covariances after updates against least squares and an augmented Kalman filter."""

from isotruss_ros.core.estimation.schmidt_filter import condition, SchmidtFilter
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
    by_offsets = RNG.normal(size=(6, 2))
    known, unknown = (
        SchmidtFilter(prior, np.zeros((4, 2)), offsets).conditioned(rates, by_offsets, noise)[0]
        for offsets in (np.zeros((2, 2)), np.eye(2))
    )
    functions, none = RNG.normal(size=(3, 4)), np.zeros((3, 2))
    more = unknown.spread(functions, none) - known.spread(functions, none)
    errors = functions @ condition(prior, rates, noise)[0] @ by_offsets
    assert more == pytest.approx(errors @ errors.T)


def test_the_filter_is_a_kalman_filter_whose_gain_for_the_parameters_is_zero():
    prior, _, _ = drawn(3, 2)
    considered = SchmidtFilter(prior, np.zeros((3, 2)), np.eye(2))
    whole = scipy.linalg.block_diag(prior, np.eye(2))
    for _ in range(6):
        decay, more, _ = (RNG.uniform(*part) for part in PARTS)
        considered = considered.predicted(decay, more, np.zeros(2))
        both = np.append(decay, [1.0, 1.0])
        whole = whole * np.outer(both, both) + np.diag([*more, 0.0, 0.0])
        (_, rates, noise), by_parameters = drawn(3, 2), RNG.normal(size=(2, 2))
        considered, gain = considered.conditioned(rates, by_parameters, noise)
        gain = np.vstack([gain, np.zeros((2, 2))])
        remaining = np.eye(5) - gain @ np.hstack([rates, by_parameters])
        whole = remaining @ whole @ remaining.T + gain @ noise @ gain.T
    functions = RNG.normal(size=(4, 5))
    expected = functions @ whole @ functions.T
    assert considered.spread(functions[:, :3], functions[:, 3:]) == pytest.approx(expected)
