# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Approach of the grasping members to the object, which is the first step of the search.

The approach is kinematic. Each of its steps fulfils the requirements, so the steps form the path.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.numerics.tolerances import MAX_SEARCH_STEPS
from isotruss_ros.core.planning.closing import Closing, evaluate_state
from isotruss_ros.core.planning.closing_step import GAP_TOLERANCE, take_closing_step
from isotruss_ros.core.planning.facing import balances, CONE_SHARE
from isotruss_ros.core.planning.violations import RequirementError
import numpy as np

#: Gap between the grasping members and the object at the end of the approach, in tube diameters
#: [-].
STANDOFF = 0.06


def approach(config: Configuration, closing: Closing) -> Iterator[Configuration]:
    """
    Yield the configurations of the path on which grasping members approach the object.

    At the end of the path the directions of the members admit force closure.
    """
    diameter, members = config.robot.description.tube_diameter, list(closing.members)
    targets = np.full(len(members), STANDOFF * diameter)
    state = evaluate_state(config, closing.body)
    angle, radius = CONE_SHARE * closing.friction_angle, 0.5 * diameter
    best, idle, share = np.inf, 0, 1.0
    while True:
        yield state.config
        gap = float((state.gaps[members] - targets).max())
        # Rotation that force closure requires [rad]; the members' directions may already admit it.
        normals, turned, missing = closing.normals(state.config), closing, 0.0
        if balances(closing.body, normals, angle, radius):
            turned = replace(closing, facing=None)
        else:
            missing = float(np.abs(np.angle(closing.facing / normals)).sum())
        shortfall = max(gap, 0.0) / diameter + missing
        if shortfall <= GAP_TOLERANCE:
            return
        idle = 0 if shortfall < best - GAP_TOLERANCE else idle + 1
        best = min(best, shortfall)
        # `idle` counts successive steps with less progress than the tolerance.
        if idle > MAX_SEARCH_STEPS:
            far = gap > GAP_TOLERANCE * diameter
            name, value = ('reach', gap) if far else ('facing', missing)
            raise RequirementError(name, value, 0.0)
        state, share = take_closing_step(state, turned, targets, share)
