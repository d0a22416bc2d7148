# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a measurement does to the covariance of a state, against other ways to compute it."""

from isotruss_ros.core.estimation.schmidt_filter import condition, SchmidtFilter
import numpy as np
import pytest
import scipy

RNG = np.random.default_rng(0)


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
    variances, by_considered = np.diag(prior), RNG.normal(size=(6, 2))
    known = SchmidtFilter(variances, np.zeros((2, 2)))
    unknown = SchmidtFilter(variances, np.eye(2))
    for each in (known, unknown):
        each.condition(rates, by_considered, noise)
    functions, none = RNG.normal(size=(3, 4)), np.zeros((3, 2))
    more = unknown.spread(functions, none) - known.spread(functions, none)
    errors = functions @ condition(np.diag(variances), rates, noise)[0] @ by_considered
    assert more == pytest.approx(errors @ errors.T)
