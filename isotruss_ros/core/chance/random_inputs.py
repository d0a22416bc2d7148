# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Inputs of a grasp with changed or random parameters, and their equilibria."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

from isotruss_ros.core.errors import ConfigurationError, GraspError
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.held_gradient import GraspParameters
from isotruss_ros.core.holding.held_grip import GraspInputs, HeldGrip
from isotruss_ros.core.holding.settle_grasps import settle_inputs_together
from isotruss_ros.core.numerics.arrays import Array, MAX_LOAD
import numpy as np

#: Smallest ratio of a random length, pressure or stiffness to its value [-].
LEAST_SHARE = 0.05


def changed_inputs(inputs: GraspInputs, change: Array, is_drawn: bool = False) -> GraspInputs:
    """
    Return the inputs of a grasp after changes (p,) of parameters.

    Normal numbers may be negative, so lengths, pressures and stiffness remain at least 0.05 times
    their values. Dents are interpolated if the changes are drawn.
    """
    columns, config = GraspParameters.of(inputs.config), inputs.config
    pressures = np.array(inputs.pressures)
    resized = inputs.body
    if change[-1] or is_drawn:
        resized = resized.scaled(max(1.0 + float(change[-1]), LEAST_SHARE), is_drawn)
    return inputs._replace(
        config=config.moved_to(config.roller_positions + change[columns.rollers]),
        body=resized.moved_to(np.array(resized.pose) + change[columns.place]),
        wrench=inputs.wrench + change[columns.wrench],
        pressures=tuple(
            np.maximum(pressures + change[columns.pressures], LEAST_SHARE * pressures).tolist()
        ),
        stiffness=max(inputs.stiffness + change[columns.stiffness], LEAST_SHARE),
    )


def changed_grip(grip: HeldGrip, change: Array) -> HeldGrip:
    """Return the equilibrium with unknown contact history after changes (p,) of parameters."""
    starts = [(grip, grip.state.unknowns)]
    return attach_grip(*changed_inputs(grip.inputs, change), starts=starts)


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
    rng, drawn = np.random.default_rng(seed), []
    for change in rng.multivariate_normal(np.zeros(len(covariance)), covariance, samples):
        # The true robot has a configuration, so a sample without one is left out.
        with suppress(ConfigurationError):
            drawn.append(changed_inputs(inputs, change, is_drawn=True))
    if not drawn:
        raise GraspError('no sample has a configuration: the roller offsets must deviate less')
    # The equilibrium does not depend on friction, so no sample slips here.
    settled = settle_inputs_together(drawn, np.full(len(drawn), MAX_LOAD), None, on_progress)
    return np.where(settled.held, settled.required_friction, np.inf)
