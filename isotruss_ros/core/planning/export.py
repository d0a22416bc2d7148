"""A planned grasp as plain numbers, names and lists: for messages, JSON, tables and sweeps."""

from __future__ import annotations

from typing import Any

from isotruss_ros.core.planning.grasp_plan import path_times, PlannedGrasp, Violation
import numpy as np


def export_figures(grasp: PlannedGrasp) -> dict[str, Any]:
    """
    Return what characterises a grasp, by name: module, members, roller positions and scores.

    The module is empty where the grip is of any members.

    :param grasp: see `PlannedGrasp` for the figures and their units.
    """
    return {
        'module': '' if grasp.grasp is None else grasp.grasp.module,
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
