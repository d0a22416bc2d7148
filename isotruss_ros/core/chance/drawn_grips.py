# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Exact equilibria of grasps with changed parameters, and what is computed from several of them.

The equilibrium does not depend on friction, so in samples the probability that friction suffices
is computed instead of drawn.
"""

from __future__ import annotations

from collections.abc import Callable
import math

from isotruss_ros.core.chance.criteria import rest_criteria, scaled
from isotruss_ros.core.chance.first_order import find_failure, violation_probability
from isotruss_ros.core.errors import ConfigurationError, GraspError, IsotrussError
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.contact_statics import TubeModel
from isotruss_ros.core.holding.held_gradient import GraspParameters
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.settle_grasp import assess_equilibrium
from isotruss_ros.core.holding.settled_grasp import SettledGrasp
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.tolerances import (
    COINCIDENCE,
    EPSILON,
    NEGLIGIBLE_SHARE,
    SMALLEST_NORMAL,
)
import numpy as np
import scipy

#: Smallest factor on stiffness, pressures and size in a draw [-].
MIN_FACTOR = 0.05
#: Step of the differences of criteria along a direction, in standard deviations [-].
STEP = 3e-3


def changed_grip(grip: HeldGrip, change: Array) -> HeldGrip:
    """Return the equilibrium with unknown contact history for changes (p,) of parameters."""
    columns, body = GraspParameters.of(grip.config), grip.statics.body
    travel = grip.config.roller_positions + change[columns.rollers]
    body = scaled(body, max(1.0 + change[-1], MIN_FACTOR))
    body = body.moved_to(np.array(body.pose) + change[columns.place])
    given = np.array(grip.statics.bent.structure.pressures)
    pressures = np.maximum(given + change[columns.pressures], MIN_FACTOR * given).tolist()
    names = grip.config.robot.description.pressures
    tubes = TubeModel(
        max(grip.tubes.stiffness_scale + change[columns.stiffness], MIN_FACTOR),
        pressure=dict(zip(names, pressures, strict=True)),
    )
    wrench = grip.wrench * (1.0, 1.0, grip.arm) + change[columns.wrench]
    return attach_grip(grip.config.moved_to(travel), body, grip.members, wrench, tubes)


def draw_held(
    settled: SettledGrasp,
    covariance: Array,
    samples: int,
    seed: int,
    on_progress: Callable[[float], None] | None = None,
) -> Array:
    """
    Return for each sample the probability that its friction suffices; zero if not held.

    Samples without a configuration are left out, because the robot has one.
    """
    grip, columns = settled.equilibrium, GraspParameters.of(settled.equilibrium.config)
    rng = np.random.default_rng(seed)
    normal = rng.standard_normal((samples, len(covariance)))
    # Values with the first five moments of a normal number, so that few dents are tabulated.
    tabulated = np.append(np.r_[columns.pressures], -1)
    normal[:, tabulated] = rng.choice(
        math.sqrt(3.0) * np.array([-1.0, 0.0, 1.0]),
        (samples, len(tabulated)),
        p=(1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0),
    )
    # Slightly larger variances make the matrix positive definite.
    slight = np.diag(COINCIDENCE * np.diag(covariance) + SMALLEST_NORMAL)
    changes = normal @ np.linalg.cholesky(covariance + slight).T
    deviation = max(math.sqrt(covariance[columns.friction, columns.friction]), EPSILON)
    changes[:, columns.friction] = 0.0
    held = np.zeros(samples)
    for i, change in enumerate(changes):
        try:
            drawn = changed_grip(grip, change)
        except ConfigurationError:
            held[i] = np.nan
            continue
        except IsotrussError:  # no equilibrium
            continue
        finally:
            if on_progress is not None:
                on_progress((i + 1) / samples)
        if assess_equilibrium(drawn.statics.body.pose, drawn, math.inf).held:
            held[i] = scipy.special.ndtr((settled.friction - drawn.required_friction) / deviation)
    held = held[~np.isnan(held)]
    if not len(held):
        raise GraspError('no sample has a configuration: the roller offsets must deviate less')
    return held


def chance_gradient(settled: SettledGrasp, find_covariance: Callable[[Array], Array]) -> Array:
    """
    Return the derivatives (p,) of the chance to first order; the last one is by size.

    The chance depends on the values g of the criteria and on their covariance A C A^T, with the
    derivatives A of g and the covariance C of the parameters. By symmetry of second derivatives,
    the derivative of A C a_j by the parameters is the derivative of A along C a_j. It is computed
    by central differences of the exact A, two equilibria for each likely violation.
    """
    grip, friction = settled.equilibrium, settled.friction
    columns = GraspParameters.of(grip.config)
    still = np.zeros(columns.size + 1)
    covariance = find_covariance(still)
    failure = find_failure(rest_criteria(grip, friction)[0], covariance)
    values, rates, matrix = failure.criteria.values, failure.criteria.rates, failure.covariance
    spread = np.sqrt(np.diag(matrix))

    def rates_at(change: Array) -> Array:
        there = changed_grip(grip, change)
        criteria, _ = rest_criteria(there, friction + change[columns.friction])
        return criteria.rates[failure.indices]

    along = np.zeros((len(spread), *rates.shape))
    for j, direction in enumerate(rates @ covariance / spread[:, None]):
        ahead, behind = rates_at(STEP * direction), rates_at(-STEP * direction)
        along[:, j] = spread[j] * (ahead - behind) / (2.0 * STEP)
    gradient = np.zeros_like(still)
    for k, unit in enumerate(np.eye(len(still))):
        # The covariance is at most quadratic in the parameters, so this difference is exact.
        varied = 0.5 * (find_covariance(unit) - find_covariance(-unit))
        change = along[..., k] + along[..., k].T + rates @ varied @ rates.T
        relative = np.abs(change / np.outer(spread, spread)).max()
        relative = max(relative, np.abs(rates[:, k] / spread).max(), SMALLEST_NORMAL)
        step = NEGLIGIBLE_SHARE / relative
        ahead, behind = (
            violation_probability(values + way * rates[:, k], matrix + way * change)
            for way in (step, -step)
        )
        gradient[k] = (behind - ahead) / (2.0 * step)
    return gradient
