# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Probability that an object is held: to first order in normal parameters, and from samples.

To first order the violations of two conditions are jointly normal. Ditlevsen's bound of their
union, sum_i p_i - sum_(i > 1) max_(j < i) p_ij (in descending order of p_i), is exact for up to
two conditions, and has no random error. It does not bound the error of the linearised conditions.
"""

from __future__ import annotations

from collections.abc import Sequence
import math

from isotruss_ros.core.chance.criteria import find_criteria
from isotruss_ros.core.holding.grasp_gradient import GraspParameters
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.model.parameter_deviations import Chance
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.numerics.tolerances import EPSILON
import numpy as np
import scipy

#: Conditions whose values exceed this many standard deviations are fulfilled [-]. The probability
#: of a violation is then below 1e-15.
MAX_SIGMAS = 8.0
#: Quantities of the columns in the fields of `GraspParameters`; the last field, p, is the size's.
QUANTITIES = 'roller offsets', 'pose', 'pressures', 'friction', 'load', 'stiffness', 'size'


@single_threaded
def find_chance(grips: Sequence[HeldGrip], friction: float, covariance: Array) -> Chance:
    """Return the chance to first order that an object is held along a path."""
    criteria, columns = find_criteria(grips, friction), GraspParameters.of(grips[0].config)
    deviations = np.sqrt(np.einsum('cp,pq,cq->c', criteria.rates, covariance, criteria.rates))
    with np.errstate(divide='ignore', invalid='ignore'):
        sigmas = np.nan_to_num(criteria.values / deviations, nan=np.inf)
    # Criteria that may be violated, the most probable violation first.
    order = np.argsort(sigmas, kind='stable')[: max(1, int((sigmas < MAX_SIGMAS).sum()))]
    certain = deviations[order, None] == 0.0
    rates = criteria.rates[order] / np.where(certain, np.inf, deviations[order, None])
    failure = failure_probability(sigmas[order], rates @ covariance @ rates.T)
    variances = rates[0] * (covariance @ rates[0])
    shares = zip(QUANTITIES, (float(variances[i].sum()) for i in columns), strict=True)
    return Chance(
        probability=1.0 - failure,
        method='first order',
        limit=criteria.names[order[0]],
        shares=dict(sorted(shares, key=lambda item: -item[1])),
        reliability=-float(scipy.special.ndtri(failure)),
    )


def failure_probability(sigmas: Array, correlation: Array) -> float:
    """Return Ditlevsen's bound of the probability that one of c conditions is violated."""
    # Probabilities (c, c) that two conditions are violated, by Owen's function T(h, a).
    root = np.sqrt(np.maximum(1.0 - correlation**2, EPSILON))
    limits = np.where(np.abs(sigmas) < EPSILON, -EPSILON, -sigmas.clip(-MAX_SIGMAS, MAX_SIGMAS))
    single, h, k = scipy.special.ndtr(limits), limits[:, None], limits[None]
    pairs = 0.5 * (single[:, None] + single - (h * k < 0.0))
    pairs -= scipy.special.owens_t(h, (k / h - correlation) / root)
    pairs -= scipy.special.owens_t(k, (h / k - correlation) / root)
    pairs = pairs.clip(0.0, np.minimum(single[:, None], single))  # against rounding
    # The largest overlap of each condition with a more probable one.
    overlap = np.tril(pairs, -1).max(axis=1).sum()
    return min(1.0, float(scipy.special.ndtr(-sigmas).sum() - overlap))


def standard_error(chances: Array) -> float:
    """
    Return the standard error of the mean of random chances (s,).

    As in the interval of Agresti and Coull, two samples that are held and two that are not are
    added, so that it is positive if all samples agree.
    """
    return float(np.std([*chances, 0.0, 0.0, 1.0, 1.0]) / math.sqrt(len(chances)))
