# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Derivatives of the chance to first order by the parameters of a grasp.

The chance depends on the values g of the criteria and on their covariance A C A^T, with the
derivatives A of g and the covariance C of the parameters. By symmetry of second derivatives, the
derivative of A C a_j by the parameters is the derivative of A along C a_j. It is computed by
central differences of the exact A, two equilibria for each likely violation.
"""

from __future__ import annotations

from collections.abc import Callable

from isotruss_ros.core.chance.criteria import rest_criteria
from isotruss_ros.core.chance.drawn_grips import changed_grip
from isotruss_ros.core.chance.failure import find_failure
from isotruss_ros.core.holding.held_gradient import GraspParameters
from isotruss_ros.core.holding.settled_grasp import SettledGrasp
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Step of the differences along a direction, in standard deviations [-].
STEP = 3e-3


def chance_gradient(settled: SettledGrasp, find_covariance: Callable[[Array], Array]) -> Array:
    """
    Return the derivatives (p,) of the chance to first order; the last one is by size.

    :param find_covariance: covariance of the parameters for changes (p,) of the parameters.
    """
    grip, friction = settled.equilibrium, settled.friction
    columns = GraspParameters.of(grip.config)
    criteria, _ = rest_criteria(grip, friction)
    covariance = find_covariance(np.zeros(columns.size + 1))
    failure = find_failure(criteria, covariance)
    rates, indices = failure.criteria.rates, failure.indices
    spread = np.sqrt(np.diag(failure.covariance))

    def rates_at(change: Array) -> Array:
        there = changed_grip(grip, change)
        return rest_criteria(there, friction + change[columns.friction])[0].rates[indices]

    along = np.zeros((len(spread), *rates.shape))
    for j, direction in enumerate(rates @ covariance / spread[:, None]):
        ahead, behind = rates_at(STEP * direction), rates_at(-STEP * direction)
        along[:, j] = spread[j] * (ahead - behind) / (2.0 * STEP)
    by_parameters = along + along.transpose(1, 0, 2)
    varying = np.r_[columns.pressures, columns.wrench]
    for k, unit in zip(varying, np.eye(columns.size + 1)[varying], strict=True):
        # The covariance is quadratic in these parameters, so the difference is exact.
        change = 0.5 * (find_covariance(unit) - find_covariance(-unit))
        by_parameters[..., k] += rates @ change @ rates.T
    variances = np.einsum('iip->ip', by_parameters) / (2.0 * spread**2)[:, None]
    sigma_rates = rates / spread[:, None] - failure.sigmas[:, None] * variances
    correlation = failure.correlation[..., None]
    correlation_rates = by_parameters / np.outer(spread, spread)[..., None]
    correlation_rates -= correlation * (variances[:, None] + variances[None])
    by_sigmas, by_correlation = failure.rates
    change = by_sigmas @ sigma_rates
    return -change - np.einsum('ij,ijp->p', by_correlation, correlation_rates)
