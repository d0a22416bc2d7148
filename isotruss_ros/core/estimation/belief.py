# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A mean and a covariance, and what measurements do to them: an iterated Kalman filter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: A step that changes no state by more than its new deviation times this is the last one ...
SMALL = 1.0
#: ... and so is this one.
MOST_STEPS = 4


class Expectation(NamedTuple):
    """
    What a measurement is expected to be in a state.

    :ivar values: (m,).
    :ivar rates: (m, n) derivatives by the state.
    """

    values: Array
    rates: Array


@dataclass(frozen=True, eq=False)
class Belief:
    """
    What is believed of a state.

    :ivar mean: (n,).
    :ivar covariance: (n, n).
    """

    mean: Array
    covariance: Array

    def spread(self, rates: Array) -> Array:
        """
        Return the covariance of what depends on the state, (m, m).

        :param rates: (m, n) its derivatives.
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
    Return what is believed after a measurement: the most probable state, by Gauss-Newton steps.

    What is considered keeps its mean and its deviation, and the others are as unsure as it makes
    them (Schmidt's consider filter).

    :param prior: before.
    :param measured: (m,).
    :param noise: (m, m) covariance of the measurement.
    :param expect: returns what it would be in a state (n,).
    :param considered: number of the state that is only considered; None for none.
    """
    mean = prior.mean
    for _ in range(MOST_STEPS):
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
        if (change <= SMALL * np.sqrt(np.diag(covariance))).all():
            break
    return Belief(mean, 0.5 * (covariance + covariance.T))
