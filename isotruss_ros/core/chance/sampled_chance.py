# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Probability that an object is held, by samples of the parameters with exact statics.

The equilibrium does not depend on friction, so the probability that friction suffices is computed
instead of drawn.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import math

from isotruss_ros.core.chance.drawn_grips import changed_grip
from isotruss_ros.core.chance.failure import Failure
from isotruss_ros.core.chance.grasp_chance import Chance
from isotruss_ros.core.errors import IsotrussError
from isotruss_ros.core.holding.held_gradient import GraspParameters
from isotruss_ros.core.holding.settle_grasp import assess_equilibrium
from isotruss_ros.core.holding.settled_grasp import SettledGrasp
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.tolerances import EPSILON
import numpy as np
import scipy


def may_change_contacts(failure: Failure) -> bool:
    """
    Return whether corners may lose or gain contact.

    Of 22 boxes, first order errs by 0.13 to 0.43 in the three within three standard deviations of
    a change that bears on the chance, and by at most 0.08, the noise of the draws, in the others.
    """
    return failure.change_sigmas < 3.0  # standard deviations


def sampled(
    settled: SettledGrasp,
    covariance: Array,
    chance: Chance,
    samples_and_seed: tuple[int, int],
    on_progress: Callable[[float], None] | None = None,
) -> Chance:
    """
    Return the chance by samples.

    :param chance: chance to first order, whose limit and shares are kept.
    :param samples_and_seed: number of samples, and seed of the random numbers.
    :param on_progress: function that is called with the completed fraction after each sample.
    """
    samples, seed = samples_and_seed
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
    spread = np.sqrt(np.diag(covariance))
    size = np.where(spread > 0.0, spread, 1.0)
    correlation = covariance / np.outer(size, size)
    np.fill_diagonal(correlation, 1.0 + EPSILON)
    changes = spread * (normal @ np.linalg.cholesky(correlation).T)
    changes[:, columns.friction] = 0.0
    held = np.zeros(samples)
    for i, change in enumerate(changes):
        try:
            drawn = changed_grip(grip, change)
        except IsotrussError:  # no equilibrium or no configuration
            continue
        finally:
            if on_progress is not None:
                on_progress((i + 1) / samples)
        if assess_equilibrium(drawn.statics.body.pose, drawn, math.inf).held:
            reserve = settled.friction - drawn.required_friction
            held[i] = scipy.special.ndtr(reserve / max(spread[columns.friction], EPSILON))
    probability = float(held.mean())
    return replace(
        chance,
        probability=probability,
        method='samples',
        standard_error=float(held.std() / math.sqrt(samples)),
        reliability=float(scipy.special.ndtri(probability)),
    )
