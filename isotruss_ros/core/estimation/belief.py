# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Gaussian belief of a state, and the belief's update by an iterated extended Kalman filter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.tolerances import MAX_SEARCH_STEPS
import numpy as np

#: Probability that valid measurements fail a gate or a comparison [-]. Some twenty independent
#: comparisons per second then have one false alarm in an hour.
FALSE_ALARM_PROBABILITY = 1.5e-5


class Expectation(NamedTuple):
    """Predicted measurement with its Jacobian, linearised at a state."""

    values: Array  #: (m,) predicted measurement
    rates: Array  #: (m, n) Jacobian of this prediction with respect to the state


@dataclass(frozen=True, eq=False)
class Belief:
    """Gaussian belief of a state: mean and covariance."""

    mean: Array  #: (n,) mean of the state
    covariance: Array  #: (n, n) covariance of the state

    def spread(self, rates: Array) -> Array:
        """
        Return the covariance (m, m) of m linear functions of the state.

        :param rates: (m, n) Jacobian of the functions.
        """
        return rates @ self.covariance @ rates.T


def update_belief(
    prior: Belief,
    measured: Array,
    noise: Array,
    expect: Callable[[Array], Expectation],
    considered: int | None = None,
) -> Belief:
    """
    Return the belief after a measurement; its mean is found by Gauss-Newton steps.

    One element of the state may be considered: its mean and variance are not updated, but the
    covariance of the other elements includes its uncertainty (Schmidt-Kalman filter).

    :param prior: belief before the measurement.
    :param measured: (m,) measurement.
    :param noise: (m, m) covariance of the measurement.
    :param expect: measurement model, a function that predicts the measurement from a state (n,).
    :param considered: index of the considered element; None: there is none.
    """
    mean = prior.mean
    for _ in range(MAX_SEARCH_STEPS):
        values, rates = expect(mean)
        crossed = prior.covariance @ rates.T
        gain = np.linalg.solve(rates @ crossed + noise, crossed.T).T
        if considered is not None:
            gain[considered] = 0.0
        missing = measured - values - rates @ (prior.mean - mean)
        moved = prior.mean + gain @ missing
        left = np.eye(len(mean)) - gain @ rates
        covariance = left @ prior.covariance @ left.T + gain @ noise @ gain.T
        change, mean = np.abs(moved - mean), moved
        if (change <= np.sqrt(np.diag(covariance))).all():
            break
    return Belief(mean, 0.5 * (covariance + covariance.T))
