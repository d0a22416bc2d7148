# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The first step of the search: bring the grasping members close to the object.

Kinematics only: from the present configuration by admissible steps, so that these are the path.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
import itertools
import math

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.planning.closing import Closing, evaluate_state
from isotruss_ros.core.planning.closing_step import take_closing_step
from isotruss_ros.core.planning.facing import balances, CONE_SHARE, find_facing, USED_SHARE
from isotruss_ros.core.planning.violations import RequirementError
import numpy as np

#: Gap of the grasping members at the end, and by how much more it may be, in tube diameters.
STANDOFF, STANDOFF_TOLERANCE = 0.06, 0.02
#: A turn of the members that may be missing at the end [rad].
TURN_TOLERANCE = 1e-3
#: Most steps, and most of them in a row without this progress [diameters of the tube, rad].
MAX_STEPS, MAX_IDLE_STEPS, MIN_PROGRESS = 100, 12, 0.02


def approach(config: Configuration, closing: Closing) -> Iterator[Configuration]:
    """
    Yield the path that brings the grasping members close to the object, so that friction holds it.

    The present configuration comes first; between them the path is straight in roller travel.

    :param config: configuration of the robot.
    :param closing: what closes.
    :raises RequirementError: the members do not get there.
    :raises SolverError: a quadratic program was not solved.
    """
    diameter, members = config.robot.description.tube_diameter, list(closing.members)
    targets = np.full(len(members), STANDOFF * diameter)
    state = evaluate_state(config, closing.body)
    best, idle, share = np.inf, 0, 1.0
    for number in itertools.count():
        yield state.config
        gap = float((state.gaps[members] - targets).max())
        missing, turned = _find_turn(state.config, closing)
        far = gap > STANDOFF_TOLERANCE * diameter
        if not far and missing <= TURN_TOLERANCE:
            return
        left = max(gap, 0.0) / diameter + missing
        idle = 0 if left < best - MIN_PROGRESS else idle + 1
        best = min(best, left)
        if idle > MAX_IDLE_STEPS or number == MAX_STEPS:
            name, value = ('reach', gap) if far else ('facing', missing)
            raise RequirementError(name, value, 0.0)
        state, share = take_closing_step(state, turned, targets, share)


def _find_turn(config: Configuration, closing: Closing) -> tuple[float, Closing]:
    """
    Return by how much the grasping members are to turn yet [rad], and what closes while they do.

    Where friction holds they need not turn. Else two members are turned toward the nearest
    directions that hold the object.
    """
    normals, angle = closing.normals(config), closing.friction_angle
    radius = 0.5 * config.robot.description.tube_diameter
    if balances(closing.body, normals, USED_SHARE * angle, radius):
        return 0.0, replace(closing, facing=None)
    if closing.facing is None:
        return math.pi, closing
    missing = float(np.abs(np.angle(closing.facing / normals)).sum())
    found = find_facing(closing.body, normals, CONE_SHARE * angle, radius)
    return missing, closing if found is None else replace(closing, facing=found)
