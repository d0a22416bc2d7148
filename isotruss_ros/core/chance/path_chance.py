# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Probability that an object is held in several equilibria between which its contacts roll.

The rollers follow their nominal travel. The rolling invariants of the first equilibrium depend on
the uncertain parameters, and stay constant.
"""

from __future__ import annotations

from collections.abc import Sequence

from isotruss_ros.core.chance.criteria import carried_criteria, Criteria, rest_criteria
from isotruss_ros.core.chance.failure import find_failure
from isotruss_ros.core.chance.grasp_chance import Chance, describe_failure
from isotruss_ros.core.chance.uncertainty import Uncertainty
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.numerics.blas_threads import single_threaded


@single_threaded
def path_chance(
    uncertainty: Uncertainty, friction: float, grips: Sequence[HeldGrip], load: HeldGrip
) -> Chance:
    """
    Return the chance to first order that the object is held along a path.

    The conditions are those of the first equilibrium, of the last one, and of those with the
    smallest slip margin and the largest utilisation.

    :param grips: equilibria along the path; the first one has an unknown contact history.
    :param load: equilibrium under the largest external wrench.
    """
    first, *others = grips
    criteria, history = rest_criteria(first, friction)
    parts = [criteria]
    if others:
        critical = {
            min(others, key=lambda grip: grip.slip_margin(friction)),
            max(others, key=lambda grip: float(grip.sections.used.max())),
            others[-1],
        }
        ordered = sorted(critical, key=others.index)
        parts += [carried_criteria(grip, friction, history.of(first, grip)) for grip in ordered]
    covariance = uncertainty.covariance(load)
    failure = find_failure(Criteria.joined(parts), covariance)
    return describe_failure(failure, covariance, first.config)
