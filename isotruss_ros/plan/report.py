"""A plan as a table for people, and as numbers for programs."""

from __future__ import annotations

import math
from typing import Any

from isotruss_ros.core import GraspPlan, GraspRequirements, PlannedGrasp, Robot
from isotruss_ros.plan.timing import path_times
from rich.table import Table


def table(plan: GraspPlan, requirements: GraspRequirements) -> Table:
    """Return one row for each grasp, best first."""
    found = Table(title=f'grasps, best first by {requirements.measure.value}')
    found.add_column('module')
    found.add_column('members that touch')
    for name in (
        'margin\n[mN]',
        'friction\nneeded',
        'contact\nforce [N]',
        'total\nforce [N]',
        'travel\n[m]',
        'rigidity',
        'score',
    ):
        found.add_column(name, justify='right')
    for grasp in plan.grasps:
        found.add_row(
            grasp.grasp.module,
            '\n'.join(grasp.members),
            f'{1e3 * grasp.closure_margin:.3f}',
            f'{grasp.required_friction:.4f}',
            f'{grasp.max_contact_force:.2f}',
            f'{grasp.total_force:.2f}',
            f'{grasp.travel:.3f}',
            f'{grasp.rigidity:.3f}',
            f'{grasp.score:.5g}',
        )
    return found


def as_json(plan: GraspPlan, robot: Robot) -> dict[str, Any]:
    """Return all of a plan that JSON can hold; what is not finite is null."""
    miss = plan.nearest_miss
    return {
        'robot': robot.name,
        'roller_names': list(robot.roller_names),
        'grasps': [_grasp(grasp, robot) for grasp in plan.grasps],
        'complete': plan.complete,
        'nearest_miss': None
        if miss is None
        else {
            'requirement': miss.requirement,
            'value': _finite(miss.value),
            'bound': _finite(miss.bound),
        },
        'evaluations': plan.evaluations,
        'analyses': plan.analyses,
        'computing_time': plan.computing_time,
    }


def _grasp(grasp: PlannedGrasp, robot: Robot) -> dict[str, Any]:
    times = path_times(grasp.path, robot.description.max_speed)
    return {
        'module': grasp.grasp.module,
        'members': list(grasp.members),
        'roller_positions': grasp.roller_positions.tolist(),
        'score': grasp.score,
        'closure_margin': grasp.closure_margin,
        'required_friction': grasp.required_friction,
        'max_contact_force': grasp.max_contact_force,
        'total_force': grasp.total_force,
        'travel': grasp.travel,
        'rigidity': grasp.rigidity,
        'path': grasp.path.tolist(),
        'times': times.tolist(),
        'touch': grasp.touch,
    }


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
