# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Probability that an object is held: to first order in normal parameters, and from samples.

To first order the violations of two conditions are jointly normal. Ditlevsen's bound of their
union, sum_i p_i - sum_(i > 1) max_(j < i) p_ij (in descending order of p_i), is exact for up to
two conditions, and has no random error. It does not bound the error of the linearised conditions.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
import math

from isotruss_ros.core.chance.criteria import find_criteria, find_unknown_rates, scaled
from isotruss_ros.core.errors import ConfigurationError, GraspError, IsotrussError
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.held_gradient import GraspParameters
from isotruss_ros.core.holding.held_grip import GraspInputs, HeldGrip
from isotruss_ros.core.holding.settle_grasp import assess_equilibrium
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.numerics.records import Record
from isotruss_ros.core.numerics.tolerances import EPSILON
import numpy as np
import scipy

#: Conditions whose values exceed this many standard deviations are fulfilled [-]. The probability
#: of a violation is then below 1e-15.
MAX_SIGMAS = 8.0
#: Quantities of the columns in the fields of `GraspParameters`; the last field, p, is the size's.
QUANTITIES = 'roller offsets', 'pose', 'pressures', 'friction', 'load', 'stiffness', 'size'


@dataclass(frozen=True, eq=False, repr=False)
class Chance(Record, headline=('probability', 'method', 'limit', 'shares', 'standard_error')):
    """Probability that an object is held although parameters are uncertain."""

    probability: float  #: probability that the object is held
    method: str  #: `first order` or `samples`
    #: most probable violation, for example `slip at south/P-Q`; the nominal hold status in words
    #: without a nominal equilibrium
    limit: str
    #: shares of the quantities in the variance of this criterion to first order, largest first;
    #: zeros without any deviation, empty without a nominal equilibrium [-]
    shares: dict[str, float]
    #: standard error of a probability from samples, positive also if all agree; 0 to first order
    standard_error: float = 0.0
    reliability: float = 0.0  #: standard normal quantile of the probability; larger is better [-]


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


def changed_inputs(inputs: GraspInputs, change: Array) -> GraspInputs:
    """Return the inputs of a grasp after changes (p,) of parameters."""
    columns, config = GraspParameters.of(inputs.config), inputs.config
    resized = scaled(inputs.body, 1.0 + change[-1])
    return inputs._replace(
        config=config.moved_to(config.roller_positions + change[columns.rollers]),
        body=resized.moved_to(np.array(resized.pose) + change[columns.place]),
        wrench=inputs.wrench + change[columns.wrench],
        pressures=tuple(inputs.pressures + change[columns.pressures]),
        # A normal number may be negative.
        stiffness=max(inputs.stiffness + change[columns.stiffness], 0.05),
    )


def changed_grip(grip: HeldGrip, change: Array) -> HeldGrip:
    """Return the equilibrium with unknown contact history after changes (p,) of parameters."""
    starts = [(grip, grip.state.unknowns)]
    return attach_grip(*changed_inputs(grip.inputs, change), starts=starts)


def sample_friction(
    inputs: GraspInputs,
    grip: HeldGrip | None,
    covariance: Array,
    samples: int,
    seed: int,
    on_progress: Callable[[float], None] | None,
) -> Array:
    """
    Return the required friction (s,) in random samples; infinite if the object is not held.

    :param inputs: nominal inputs of the grasp.
    :param grip: nominal equilibrium; None: there is none.
    """
    rng = np.random.default_rng(seed)
    changes = rng.multivariate_normal(np.zeros(len(covariance)), covariance, samples)
    required: list[float] = []
    # The first equilibrium with each set of corners in contact, its change, and the derivatives of
    # its unknowns, by which Newton's method starts at linearly extrapolated unknowns.
    models = {}
    if grip is not None:
        nominal = np.zeros(len(covariance))
        models[grip.contacts.corners.tobytes()] = grip, nominal, find_unknown_rates(grip)[0]
    for i, change in enumerate(changes):
        starts = [
            (near, near.state.unknowns + rates @ (change - near_change))
            for near, near_change, rates in models.values()
        ]
        try:
            drawn = attach_grip(*changed_inputs(inputs, change), starts=starts)
            held = assess_equilibrium(drawn.statics.body.pose, drawn, math.inf).held
            required.append(drawn.required_friction if held else math.inf)
            corners = drawn.contacts.corners.tobytes()
            if held and corners not in models:
                models[corners] = drawn, change, find_unknown_rates(drawn)[0]
        except ConfigurationError:
            pass  # The true robot has a configuration, so a sample without one is left out.
        except IsotrussError:  # no equilibrium
            required.append(math.inf)
        if on_progress is not None:
            on_progress((i + 1) / samples)
    if not required:
        raise GraspError('no sample has a configuration: the roller offsets must deviate less')
    return np.array(required)


def standard_error(chances: Array) -> float:
    """
    Return the standard error of the mean of random chances (s,).

    As in the interval of Agresti and Coull, two samples that are held and two that are not are
    added, so that it is positive if all samples agree.
    """
    return float(np.std([*chances, 0.0, 0.0, 1.0, 1.0]) / math.sqrt(len(chances)))
