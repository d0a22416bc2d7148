# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Inputs of a grasp with changed or random parameters, and their equilibria."""

from __future__ import annotations

from collections.abc import Callable

from isotruss_ros.core.errors import ConfigurationError, GraspError
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.grasp_gradient import GraspParameters
from isotruss_ros.core.holding.held_grip import GraspInputs, HeldGrip
from isotruss_ros.core.holding.settle_grasp import settle_inputs_together
from isotruss_ros.core.numerics.arrays import Array, MAX_LOAD
import numpy as np

#: Smallest ratio of a random length, pressure or stiffness to its value [-].
LEAST_SHARE = 0.05


def changed_inputs(
    inputs: GraspInputs, changes: Array, are_drawn: bool = False
) -> list[GraspInputs | ConfigurationError]:
    """
    Return the inputs of a grasp after n changes (n, p) of parameters, or their errors.

    Normal numbers may be negative, so lengths, pressures and stiffness remain at least 0.05 times
    their values. Dents are interpolated if the changes are drawn.
    """
    columns, config = GraspParameters.of(inputs.config), inputs.config
    given = np.array(inputs.pressures)
    pressures = np.maximum(given + changes[:, columns.pressures], LEAST_SHARE * given).tolist()
    configs = config.moved_together(config.roller_positions + changes[:, columns.rollers])
    changed: list[GraspInputs | ConfigurationError] = []
    for change, pressure, moved in zip(changes, pressures, configs, strict=True):
        if isinstance(moved, ConfigurationError):
            changed.append(moved)
            continue
        body = inputs.body
        if change[-1] or are_drawn:
            body = body.scaled(max(1.0 + float(change[-1]), LEAST_SHARE), are_drawn)
        varied = inputs._replace(
            config=moved,
            body=body.moved_to(np.array(body.pose) + change[columns.place]),
            wrench=inputs.wrench + change[columns.wrench],
            pressures=tuple(pressure),
            stiffness=max(inputs.stiffness + change[columns.stiffness], LEAST_SHARE),
        )
        changed.append(varied)
    return changed


def changed_grip(grip: HeldGrip, change: Array) -> HeldGrip:
    """Return the equilibrium with unknown contact history after changes (p,) of parameters."""
    (inputs,) = changed_inputs(grip.inputs, change[None])
    if isinstance(inputs, ConfigurationError):
        raise inputs
    return attach_grip(*inputs, near=grip)


def sample_friction(
    inputs: GraspInputs,
    covariance: Array,
    samples: int,
    seed: int,
    on_progress: Callable[[float], None] | None = None,
) -> Array:
    """
    Return the required friction (s,) in random samples; infinite if the object is not held.

    The inputs are those of the nominal grasp.
    """
    rng = np.random.default_rng(seed)
    changes = rng.multivariate_normal(np.zeros(len(covariance)), covariance, samples)
    # The true robot has a configuration, so a sample without one is left out.
    changed = changed_inputs(inputs, changes, are_drawn=True)
    drawn = [one for one in changed if isinstance(one, GraspInputs)]
    if not drawn:
        raise GraspError('no sample has a configuration: the roller offsets must deviate less')
    # The equilibrium does not depend on friction, so no sample slips here.
    limits = np.full(len(drawn), MAX_LOAD)
    settled = settle_inputs_together(drawn, limits, None, on_progress)
    return np.where(settled.held, settled.required_friction, np.inf)
