# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Probability that an object is held, to first order in the parameters."""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core.chance.criteria import rest_criteria
from isotruss_ros.core.chance.failure import Failure, find_failure
from isotruss_ros.core.holding.held_gradient import GraspParameters
from isotruss_ros.core.holding.settled_grasp import SettledGrasp
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.records import Record
import scipy


@dataclass(frozen=True, eq=False, repr=False)
class Chance(Record, headline=('probability', 'method', 'limit', 'shares', 'standard_error')):
    """
    Probability that an object is held although parameters are uncertain.

    :ivar probability: probability that the object is held. To first order, it is a lower bound,
        see `failure`.
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


def first_order(settled: SettledGrasp, covariance: Array) -> tuple[Chance, Failure]:
    """Return the chance for a covariance (p, p) of the parameters, and the likely violations."""
    criteria, _ = rest_criteria(settled.equilibrium, settled.friction)
    failure = find_failure(criteria, covariance)
    return describe_failure(failure, covariance, settled.equilibrium.config), failure


def describe_failure(failure: Failure, covariance: Array, config: Configuration) -> Chance:
    """Return the chance of not failing, with the shares of the most probable violation."""
    rates, columns = failure.criteria.rates[0], GraspParameters.of(config)
    variances, failing = rates * (covariance @ rates), failure.probability
    shares = {
        name: float(variances[getattr(columns, field)].sum() / max(variances.sum(), 1e-300))
        for field, name in QUANTITIES.items()
    }
    return Chance(
        probability=1.0 - failing,
        method='first order',
        limit=failure.criteria.names[0],
        shares=dict(sorted(shares.items(), key=lambda item: -item[1])),
        reliability=-float(scipy.special.ndtri(failing)),
    )
