# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Error of a chance to first order, from exact equilibria within two deviations.

The criteria are compared with their linearisation at two deviations of each independent parameter
to either side, which shows curvature and kinks, and at the most probable point of each of the most
probable violations, if it is nearer. A difference e in units of the standard deviation of a
criterion that is violated beyond b deviations changes the chance by e times the density at b.
"""

from __future__ import annotations

import math

from isotruss_ros.core.chance.criteria import find_criteria
from isotruss_ros.core.chance.random_inputs import changed_inputs
from isotruss_ros.core.holding.grasp_gradient import GraspParameters
from isotruss_ros.core.holding.held_grip import GraspInputs, HeldGrip, HoldStatus
from isotruss_ros.core.holding.settle_grasp import settle_inputs_together
from isotruss_ros.core.holding.settled_grasp import SettledGrasps
from isotruss_ros.core.numerics.arrays import Array, MAX_LOAD
from isotruss_ros.core.numerics.tolerances import EPSILON
import numpy as np

#: Distance at which curvature and kinks are tested, in deviations [-].
REACH = 2.0
#: Number of the most probable violations whose most probable points are tested [-].
VIOLATIONS = 4
#: Hold statuses with values of all compared criteria.
COMPARED = HoldStatus.HELD, HoldStatus.WRINKLES


def first_order_error(grip: HeldGrip, friction: float, covariance: Array) -> float:
    """
    Return the estimated error of the chance to first order [-].

    It is 1 if an equilibrium is lost, or not alike, where the linearised criteria are fulfilled.
    """
    criteria = find_criteria([grip], friction)
    deviations = np.sqrt(np.einsum('cp,pq,cq->c', criteria.rates, covariance, criteria.rates))
    sizes = np.maximum(deviations, EPSILON)
    sigmas = criteria.values / sizes
    axes = _independent_axes(covariance)
    changes = np.concatenate([REACH * axes, -REACH * axes])
    likely = np.argsort(sigmas, kind='stable')[:VIOLATIONS]
    directions = criteria.rates[likely] @ covariance / sizes[likely, None]
    distances = np.clip(sigmas[likely], -REACH, REACH)
    changes = np.concatenate([changes, -distances[:, None] * directions])

    changed = changed_inputs(grip.inputs, changes, are_drawn=True)
    inputs = [one for one in changed if isinstance(one, GraspInputs)]
    if len(inputs) < len(changed):  # not all of these robots exist
        return 1.0
    settled = settle_inputs_together(inputs, np.full(len(inputs), MAX_LOAD))
    linear = criteria.values + changes @ criteria.rates.T
    has_values = np.array([hold in COMPARED for hold in settled.hold])
    if (~has_values & (linear > 0.0).all(axis=1)).any():
        return 1.0
    by_friction = changes[:, GraspParameters.of(grip.config).friction]
    exact = _compared_values(settled, grip, friction + by_friction)
    count = exact.shape[1]
    errors = np.where(has_values[:, None], exact - linear[:, :count], 0.0) / sizes[:count]
    # Second differences are four times the second derivative, of which the mean is half.
    both = 2 * len(axes)
    shifts = np.abs(errors[:both].sum(axis=0)) / 8.0
    bends = np.zeros(count)
    for row, number in enumerate(likely.tolist()):
        if number < count:
            bends[number] = abs(errors[both + row, number])
    density = np.exp(-0.5 * sigmas[:count] ** 2) / math.sqrt(2.0 * math.pi)
    is_variable = deviations[:count] > 0.0
    return min(1.0, float((density * (shifts + bends))[is_variable].sum()))


def _independent_axes(covariance: Array) -> Array:
    """Return the changes (d, p) of one deviation of independent combinations of parameters."""
    deviations = np.sqrt(np.diag(covariance))
    varied = np.flatnonzero(deviations > 0.0)
    sizes = deviations[varied]
    correlation = covariance[np.ix_(varied, varied)] / np.outer(sizes, sizes)
    squares, vectors = np.linalg.eigh(correlation)
    axes = np.zeros((len(varied), len(covariance)))
    axes[:, varied] = (vectors * np.sqrt(np.maximum(squares, 0.0))).T * sizes
    return axes[squares > EPSILON]


def _compared_values(settled: SettledGrasps, grip: HeldGrip, friction: Array) -> Array:
    """Return the first criteria (n, c) of `find_criteria` of n equilibria."""
    names = grip.member_names
    normal = np.array([settled.normal_forces[name] for name in names])
    with np.errstate(divide='ignore', invalid='ignore'):
        used = np.array([-settled.friction_forces[name] for name in names]) / normal
    utilisation = np.array(list(settled.utilisation.values()))
    return np.concatenate([friction - used, friction + used, normal, 1.0 - utilisation]).T
