# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What measurements do to a belief, against other ways to compute it."""

from isotruss_ros.core.estimation.belief import Belief, Expectation, update_belief
import numpy as np
import pytest
import scipy

RNG = np.random.default_rng(0)


def _draw(size, count):
    """Return a random prior, rates, noise and measurement."""
    spread = RNG.normal(size=(size, size))
    prior = Belief(RNG.normal(size=size), spread @ spread.T + np.eye(size))
    noise = np.diag(RNG.uniform(0.1, 1.0, count))
    return prior, RNG.normal(size=(count, size)), noise, RNG.normal(size=count)


def _update(prior, rates, noise, measured, considered=None):
    return update_belief(
        prior, measured, noise, lambda mean: Expectation(rates @ mean, rates), considered
    )


def test_a_linear_update_is_least_squares():
    prior, rates, noise, measured = _draw(5, 8)
    found = _update(prior, rates, noise, measured)
    root = np.linalg.cholesky(np.linalg.inv(prior.covariance)).T
    rows = np.vstack([root, rates / np.sqrt(np.diag(noise))[:, None]])
    right = np.concatenate([root @ prior.mean, measured / np.sqrt(np.diag(noise))])
    best = scipy.linalg.lstsq(rows, right)[0]
    assert found.mean == pytest.approx(best)
    assert found.covariance == pytest.approx(np.linalg.inv(rows.T @ rows))


def test_considered_state_is_constant_and_increases_the_covariance():
    prior, rates, noise, measured = _draw(4, 6)
    found = _update(prior, rates, noise, measured, 3)
    assert found.mean[3] == prior.mean[3]
    assert found.covariance[3, 3] == pytest.approx(prior.covariance[3, 3])
    assert (
        np.diag(found.covariance) >= np.diag(_update(prior, rates, noise, measured).covariance)
    ).all()


def test_a_nonlinear_measurement_is_linearised_at_the_most_probable_state():
    prior = Belief(np.array([2.0]), np.array([[1.0]]))

    def expect(mean):
        return Expectation(mean**2, np.diag(2.0 * mean))

    noise = np.eye(1) * 1e-4
    found = update_belief(prior, np.array([9.0]), noise, expect)
    best = scipy.optimize.minimize_scalar(
        lambda x: (x - 2.0) ** 2 + (x**2 - 9.0) ** 2 / 1e-4, bracket=(2.5, 3.5)
    ).x
    assert found.mean[0] == pytest.approx(best, abs=1e-4)
