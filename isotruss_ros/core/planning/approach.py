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
from typing import NamedTuple

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.planning.closing import (
    Closing,
    evaluate_state,
    outward_normals,
    SearchState,
)
from isotruss_ros.core.planning.closing_step import take_closing_step
from isotruss_ros.core.planning.facing import balances, find_facing
from isotruss_ros.core.planning.grasp_plan import SearchTally
import numpy as np


class Approach(NamedTuple):
    """
    The path to an open grip.

    :ivar path: configurations along it, the present one first; straight in roller travel between.
    :ivar unmet: name and value of the requirement that is not met; None if all are.
    """

    path: tuple[Configuration, ...]
    unmet: tuple[str, float] | None = None


def approach(
    config: Configuration,
    closing: Closing,
    tally: SearchTally,
    should_stop: Callable[[], bool] | None = None,
) -> Approach:
    """
    Bring the grasping members close to the object, facing it so that friction can hold it.

    :param config: configuration of the robot.
    :param closing: what closes.
    :param tally: of the search.
    :param should_stop: called before every step; an approach that was stopped returns the
        requirement that was not met yet.
    :raises SolverError: a quadratic program was not solved.
    """
    settings, diameter = closing.settings, config.robot.description.tube_diameter
    standoff, tolerance = settings.standoff * diameter, settings.standoff_tolerance * diameter
    members, targets = list(closing.members), [standoff] * len(closing.members)
    path, state = [config], evaluate_state(config, closing.body)
    best, idle, share = np.inf, 0, 1.0
    while True:
        gap = float(state.gaps[members].max()) - standoff
        missing = missing_turn(state, closing)
        if gap <= tolerance and missing <= 1e-3:
            return Approach(tuple(path))
        left = max(gap, 0.0) / diameter + missing
        idle = 0 if left < best - settings.min_progress else idle + 1
        best = min(best, left) if idle else left
        unmet = ('reach', gap) if gap > tolerance else ('facing', missing)
        aborted = idle > settings.max_idle_steps or len(path) > settings.max_approach_steps
        if not aborted and not (should_stop is not None and should_stop()):
            turned = turned_closing(state, closing, missing)
            step = take_closing_step(state, turned, targets, share, tally)
            if step.blocked is None:
                state, share = step.state, step.share
                path.append(state.config)
                continue
            unmet = step.blocked
        return Approach(tuple(path), unmet)


def turned_closing(state: SearchState, closing: Closing, missing: float) -> Closing:
    """
    Return what closes, two members turned toward the nearest directions that hold the object.

    :param state: where the robot is.
    :param closing: what closes.
    :param missing: see `missing_turn` [rad]; where friction holds they need not turn.
    """
    if closing.facing is None:
        return closing
    if missing <= 0.0:
        return replace(closing, facing=None)
    settings, normals = closing.settings, outward_normals(state.config, closing)
    angle = settings.cone_share * closing.friction_angle
    found = find_facing(closing.body, normals, angle, settings.turning_price)
    return closing if found is None else replace(closing, facing=found)


def missing_turn(state: SearchState, closing: Closing) -> float:
    """
    Return by how much the grasping members are to turn yet, zero where friction holds [rad].

    :param state: where the robot is.
    :param closing: what closes.
    """
    normals = outward_normals(state.config, closing)
    angle = closing.settings.used_share * closing.friction_angle
    if balances(closing.body, normals, angle):
        return 0.0
    if closing.facing is None:
        return math.pi
    return float(np.abs(np.angle(closing.facing / normals)).sum())
