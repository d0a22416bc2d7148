# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The first step of the search: bring the grasping members close to the object.

Kinematics only: from the present configuration by admissible steps, so that these are the path.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import math

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.planning.closing import Closing, evaluate_state
from isotruss_ros.core.planning.closing_step import take_closing_step
from isotruss_ros.core.planning.facing import balances, CONE_SHARE, find_facing, USED_SHARE
import numpy as np

#: Gap of the grasping members at the end, and by how much more it may be, in tube diameters.
STANDOFF, STANDOFF_TOLERANCE = 0.06, 0.02
#: A turn of the members that may be missing at the end [rad].
TURN_TOLERANCE = 1e-3
#: Most steps, and most of them in a row without this progress [diameters of the tube, rad].
MAX_STEPS, MAX_IDLE_STEPS, MIN_PROGRESS = 100, 12, 0.02


def approach(
    config: Configuration, closing: Closing, should_stop: Callable[[], bool] | None = None
) -> tuple[list[Configuration], tuple[str, float, float] | None]:
    """
    Bring the grasping members close to the object, facing it so that friction can hold it.

    :param config: configuration of the robot.
    :param closing: what closes.
    :param should_stop: called before every step; an approach that was stopped returns the
        requirement that was not met yet.
    :return: configurations along the path, the present one first, straight in roller travel
        between; and name, value and bound of the requirement that is not met, None if all are.
    :raises SolverError: a quadratic program was not solved.
    """
    diameter, members = config.robot.description.tube_diameter, list(closing.members)
    targets = np.full(len(members), STANDOFF * diameter)
    path, state = [config], evaluate_state(config, closing.body)
    best, idle, share = np.inf, 0, 1.0
    while True:
        gap = float((state.gaps[members] - targets).max())
        missing, turned = find_turn(state.config, closing)
        unmet = ('facing', missing, 0.0) if missing > TURN_TOLERANCE else None
        if gap > STANDOFF_TOLERANCE * diameter:
            unmet = 'reach', gap, 0.0
        left = max(gap, 0.0) / diameter + missing
        idle = 0 if left < best - MIN_PROGRESS else idle + 1
        best = min(best, left) if idle else left
        if unmet is None or idle > MAX_IDLE_STEPS or len(path) > MAX_STEPS:
            return path, unmet
        if should_stop is not None and should_stop():
            return path, unmet
        state, share, blocked = take_closing_step(state, turned, targets, share)
        if blocked is not None:
            return path, blocked
        path.append(state.config)


def find_turn(config: Configuration, closing: Closing) -> tuple[float, Closing]:
    """
    Return by how much the grasping members are to turn yet [rad], and what closes while they do.

    Where friction holds they need not turn. Else two members are turned toward the nearest
    directions that hold the object.

    :param config: configuration of the robot.
    :param closing: what closes.
    """
    normals, angle = closing.normals(config), closing.friction_angle
    balanced = balances(closing.body, normals, USED_SHARE * angle)
    if closing.facing is None:
        return 0.0 if balanced else math.pi, closing
    missing = 0.0 if balanced else float(np.abs(np.angle(closing.facing / normals)).sum())
    if missing == 0.0:
        return 0.0, replace(closing, facing=None)
    found = find_facing(closing.body, normals, CONE_SHARE * angle)
    return missing, closing if found is None else replace(closing, facing=found)
