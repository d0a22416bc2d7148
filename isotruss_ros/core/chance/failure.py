# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Probability that one of several conditions is violated, to first order in normal parameters.

The violations of two conditions are jointly normal. Ditlevsen's upper bound
p <= sum_i p_i - sum_(i > 1) max_(j < i) p_ij (in descending order of p_i) is exact for up to two
conditions, and has no random error.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.chance.criteria import Criteria
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.numerics.tolerances import EPSILON, ROUNDING
import numpy as np
import scipy

#: Conditions whose values exceed this many standard deviations are fulfilled [-]. The probability
#: of a violation is then below 1e-15.
MAX_SIGMAS = 8.0


class Failure(NamedTuple):
    """Probability of a violation, with the conditions that may be violated."""

    criteria: Criteria  #: likely violations, most probable first; at least one
    indices: Indices  #: (c,) their indices among the given conditions
    covariance: Array  #: (c, c) covariance of their values
    sigmas: Array  #: (c,) their values in standard deviations [-]
    #: smallest distance of a contact from a change, in standard deviations [-]
    change_sigmas: float

    @property
    def correlation(self) -> Array:
        """Return the correlation coefficients (c, c) of the values."""
        spread = np.maximum(np.sqrt(np.diag(self.covariance)), EPSILON)
        return self.covariance / np.outer(spread, spread)

    @property
    def joint(self) -> tuple[Array, Indices]:
        """Return the largest probabilities of a joint violation with one before, and which."""
        pairs = np.tril(_joint(self.sigmas, self.correlation), -1)
        return pairs.max(axis=1), pairs.argmax(axis=1)

    @property
    def probability(self) -> float:
        """Return the upper bound of the probability of a violation."""
        return min(1.0, float(scipy.special.ndtr(-self.sigmas).sum() - self.joint[0].sum()))

    @property
    def rates(self) -> tuple[Array, Array]:
        """Return the derivatives of `probability` by `sigmas` (c,) and `correlation` (c, c)."""
        joint, partners = self.joint
        by_sigmas, by_correlation = -_density(self.sigmas), np.zeros_like(self.covariance)
        for i in np.flatnonzero(joint).tolist():
            j = int(partners[i])
            correlation = self.correlation[i, j]
            root = np.sqrt(1.0 - correlation**2)
            for one, other in (i, j), (j, i):
                given = (correlation * self.sigmas[one] - self.sigmas[other]) / root
                by_sigmas[one] += _density(self.sigmas[one]) * scipy.special.ndtr(given)
            given = (self.sigmas[j] - correlation * self.sigmas[i]) / root
            by_correlation[i, j] -= _density(self.sigmas[i]) * _density(given) / root
        return by_sigmas, by_correlation


def find_failure(criteria: Criteria, covariance: Array) -> Failure:
    """Return the likely violations for the covariance (p, p) of the parameters."""
    spread = np.sqrt(np.einsum('cp,pq,cq->c', criteria.rates, covariance, criteria.rates))
    with np.errstate(divide='ignore', invalid='ignore'):
        sigmas = np.nan_to_num(criteria.values / spread, nan=np.inf)
    change_sigmas = float(sigmas[criteria.changing].min(initial=np.inf))
    sigmas[criteria.changing] = np.inf  # no violation
    order = np.argsort(sigmas, kind='stable')
    order = order[: max(1, int((sigmas < MAX_SIGMAS).sum()))]
    axes = criteria.rates[order] / np.maximum(spread[order, None], np.finfo(float).tiny)
    # A condition that is fully correlated with a more probable violation adds nothing.
    same = np.tril(axes @ covariance @ axes.T, -1) > 1.0 - ROUNDING
    order = order[~same.any(axis=1)]
    likely = criteria.chosen(order)
    matrix = likely.rates @ covariance @ likely.rates.T
    return Failure(likely, order, matrix, sigmas[order], change_sigmas)


def _density(x: Array) -> Array:
    return np.exp(-0.5 * x**2) / np.sqrt(2.0 * np.pi)


def _joint(sigmas: Array, correlation: Array) -> Array:
    """Return the probabilities (c, c) that two conditions are violated, by Owen's function."""
    root = np.sqrt(np.maximum(1.0 - correlation**2, EPSILON))
    limits = np.where(np.abs(sigmas) < EPSILON, -EPSILON, -sigmas.clip(-MAX_SIGMAS, MAX_SIGMAS))
    h, k = limits[:, None], limits[None]
    both = 0.5 * (scipy.special.ndtr(h) + scipy.special.ndtr(k) - (h * k < 0.0))
    both = both - scipy.special.owens_t(h, (k / h - correlation) / root)
    both = both - scipy.special.owens_t(k, (h / k - correlation) / root)
    single = scipy.special.ndtr(limits)
    return np.clip(both, 0.0, np.minimum(single[:, None], single))
