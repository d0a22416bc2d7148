# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A planned grasp as plain numbers, names and lists: for messages, JSON, tables and sweeps."""

from __future__ import annotations

from typing import Any

from isotruss_ros.core.planning.grasp_plan import path_times, PlannedGrasp, Violation
import numpy as np


def export_figures(grasp: PlannedGrasp) -> dict[str, Any]:
    """
    Return what characterises a grasp, by name: module, members, roller positions and scores.

    The module is empty where the members of the grip do not meet at one.

    :param grasp: see `PlannedGrasp` for the figures and their units.
    """
    return {
        'module': grasp.module or '',
        'members': list(grasp.members),
        'roller_positions': grasp.roller_positions.tolist(),
        'score': grasp.score,
        'squeeze': grasp.squeeze,
        'slip_margin': grasp.slip_margin,
        'closure_margin': grasp.closure_margin,
        'required_friction': grasp.required_friction,
        'max_contact_force': grasp.max_contact_force,
        'total_force': grasp.total_force,
        'utilisation': grasp.utilisation,
        'travel': grasp.travel,
        'rigidity': grasp.rigidity,
    }


def export_path(grasp: PlannedGrasp) -> dict[str, Any]:
    """
    Return the path to a grasp: `path` (k, r) [m], `times` (k,) [s], and the row `touch`.

    :param grasp: driven at the largest speed of the robot's rollers, and at `NEAR_SHARE` of it
        from two waypoints before the touch on.
    """
    near = np.arange(len(grasp.path) - 1) >= grasp.touch - 2
    times = path_times(grasp.path, grasp.config.robot.description.max_speed, near)
    return {'path': grasp.path.tolist(), 'times': times.tolist(), 'touch': grasp.touch}


def export_violation(violation: Violation | None) -> dict[str, Any]:
    """
    Return which requirement is violated, with value and bound; nothing where none is.

    :param violation: the closest one of a search.
    """
    if violation is None:
        return {}
    return {
        'violated_requirement': violation.requirement,
        'violation_value': float(violation.value),
        'violation_bound': float(violation.bound),
    }
