# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Probability that an object is held, to first order in normally distributed parameters.

The violations of two conditions are jointly normal. Ditlevsen's upper bound
p <= sum_i p_i - sum_(i > 1) max_(j < i) p_ij (in descending order of p_i) is exact for up to two
conditions, and has no random error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from isotruss_ros.core.chance.criteria import carried_criteria, Criteria, rest_criteria
from isotruss_ros.core.holding.held_gradient import GraspParameters
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.numerics.records import Record
from isotruss_ros.core.numerics.tolerances import EPSILON, ROUNDING, SMALLEST_NORMAL
import numpy as np
import scipy

#: Conditions whose values exceed this many standard deviations are fulfilled [-]. The probability
#: of a violation is then below 1e-15.
MAX_SIGMAS = 8.0
#: Quantities, by the fields of `GraspParameters` that they vary.
QUANTITIES = {
    'rollers': 'roller offsets',
    'place': 'pose',
    'pressures': 'pressures',
    'friction': 'friction',
    'wrench': 'load',
    'stiffness': 'stiffness',
    'size': 'size',
}


@dataclass(frozen=True, eq=False, repr=False)
class Chance(Record, headline=('probability', 'method', 'limit', 'shares', 'standard_error')):
    """
    Probability that an object is held although parameters are uncertain.

    :ivar probability: probability that the object is held. To first order, it is a lower bound,
        see `first_order`.
    :ivar method: `first order`, `samples`, or `no equilibrium`.
    :ivar limit: most probable violation, for example `slip at south/P-Q`.
    :ivar shares: shares of the uncertain quantities in the variance of the limiting condition to
        first order, largest first [-].
    :ivar standard_error: standard error of a probability from samples; 0 to first order.
    :ivar reliability: standard normal quantile of the probability; larger is better [-].
    """

    probability: float
    method: str
    limit: str
    shares: dict[str, float]
    standard_error: float = 0.0
    reliability: float = 0.0


class Failure(NamedTuple):
    """Probability of a violation, with the c likely violations, most probable first."""

    probability: float  #: upper bound of the probability of a violation
    criteria: Criteria  #: conditions that may be violated; at least one
    indices: Indices  #: (c,) their indices among the given conditions
    covariance: Array  #: (c, c) covariance of their values
    #: smallest distance of a contact from a change, in standard deviations [-]
    change_sigmas: float


def find_failure(criteria: Criteria, covariance: Array) -> Failure:
    """Return the likely violations for the covariance (p, p) of the parameters."""
    spread = np.sqrt(np.einsum('cp,pq,cq->c', criteria.rates, covariance, criteria.rates))
    with np.errstate(divide='ignore', invalid='ignore'):
        sigmas = np.nan_to_num(criteria.values / spread, nan=np.inf)
    change_sigmas = float(sigmas[criteria.changing].min(initial=np.inf))
    sigmas[criteria.changing] = np.inf  # no violation
    order = np.argsort(sigmas, kind='stable')
    order = order[: max(1, int((sigmas < MAX_SIGMAS).sum()))]
    axes = criteria.rates[order] / np.maximum(spread[order, None], SMALLEST_NORMAL)
    # A condition that is fully correlated with a more probable violation adds nothing.
    same = np.tril(axes @ covariance @ axes.T, -1) > 1.0 - ROUNDING
    order = order[~same.any(axis=1)]
    names = tuple(criteria.names[i] for i in order.tolist())
    likely = Criteria(names, *(part[order] for part in criteria[1:]))
    matrix = likely.rates @ covariance @ likely.rates.T
    probability = violation_probability(likely.values, matrix)
    return Failure(probability, likely, order, matrix, change_sigmas)


def violation_probability(values: Array, covariance: Array) -> float:
    """Return the bound for conditions with values (c,), most probable violation first."""
    spread = np.sqrt(np.diag(covariance))
    with np.errstate(divide='ignore', invalid='ignore'):
        sigmas = np.nan_to_num(values / spread, nan=np.inf)
    spread = np.maximum(spread, EPSILON)
    correlation = covariance / np.outer(spread, spread)
    # Probabilities (c, c) that two conditions are violated, by Owen's function.
    root = np.sqrt(np.maximum(1.0 - correlation**2, EPSILON))
    limits = np.where(np.abs(sigmas) < EPSILON, -EPSILON, -sigmas.clip(-MAX_SIGMAS, MAX_SIGMAS))
    single, h, k = scipy.special.ndtr(limits), limits[:, None], limits[None]
    both = 0.5 * (single[:, None] + single - (h * k < 0.0))
    both -= scipy.special.owens_t(h, (k / h - correlation) / root)
    both -= scipy.special.owens_t(k, (h / k - correlation) / root)
    both = np.tril(both.clip(0.0, np.minimum(single[:, None], single)), -1)
    return min(1.0, float(scipy.special.ndtr(-sigmas).sum() - both.max(axis=1).sum()))


def chance_of(failure: Failure, covariance: Array, grip: HeldGrip) -> Chance:
    """Return the chance of no failure for the covariance (p, p) of the parameters."""
    rates, columns = failure.criteria.rates[0], GraspParameters.of(grip.config)
    variances = rates * (covariance @ rates)
    variances = variances / max(variances.sum(), SMALLEST_NORMAL)
    shares = {
        name: float(variances[getattr(columns, field)].sum()) for field, name in QUANTITIES.items()
    }
    return Chance(
        probability=1.0 - failure.probability,
        method='first order',
        limit=failure.criteria.names[0],
        shares=dict(sorted(shares.items(), key=lambda item: -item[1])),
        reliability=-float(scipy.special.ndtri(failure.probability)),
    )


def path_criteria(grips: Sequence[HeldGrip], friction: float) -> Criteria:
    """
    Return the conditions that an object is held in equilibria between which its contacts roll.

    The first equilibrium has an unknown contact history; the rollers follow their nominal travel.
    The conditions are those of the first equilibrium, of the last one, and of those with the
    smallest slip margin and the largest utilisation.
    """
    first, *others = grips
    criteria, history = rest_criteria(first, friction)
    if not others:
        return criteria
    critical = {
        min(others, key=lambda grip: grip.slip_margin(friction)),
        max(others, key=lambda grip: float(grip.sections.used.max())),
        others[-1],
    }
    ordered = sorted(critical, key=others.index)
    parts = [carried_criteria(grip, friction, history.of(first, grip)) for grip in ordered]
    return Criteria.joined([criteria, *parts])
