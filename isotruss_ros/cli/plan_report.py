# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Report of a grasp search, as a table for people and as JSON for programs."""

from __future__ import annotations

import math
from typing import Any

from isotruss_ros.core import GraspRequirements, Robot
from isotruss_ros.core.planning.grasp_plan import export_figures, export_path, GraspPlan
from rich.table import Table

#: Heading, unit factor and number format of each quantity of a grasp in the table.
COLUMNS = {
    'squeeze': ('squeeze\n[N]', 1.0, '{:.2f}'),
    'slip_margin': ('slips at\n[N]', 1.0, '{:.2f}'),
    'max_contact_force': ('contact\nforce [N]', 1.0, '{:.2f}'),
    'total_force': ('total\nforce [N]', 1.0, '{:.2f}'),
    'utilisation': ('moment /\nwrinkling', 1.0, '{:.2f}'),
    'travel': ('travel\n[m]', 1.0, '{:.3f}'),
    'rigidity': ('rigidity', 1.0, '{:.3f}'),
    'score': ('score', 1.0, '{:.5g}'),
    'chance': ('chance', 1.0, '{:.3f}'),
}


def table(plan: GraspPlan, requirements: GraspRequirements) -> Table:
    """Return a table with one row for each grasp, best first."""
    certain = plan[0].chance is None
    criterion = requirements.measure.value if certain else 'chance'
    columns = {name: column for name, column in COLUMNS.items() if name != 'chance' or not certain}
    report = Table(title=f'grasps, best first by {criterion}')
    report.add_column('module')
    report.add_column('members in contact')
    for heading, _, _ in columns.values():
        report.add_column(heading, justify='right')
    if any(grasp.outside_model for grasp in plan.grasps):
        report.caption = 'moment / wrinkling above 1: a tube wrinkles, outside of the model'
    for grasp in plan.grasps:
        figures = export_figures(grasp)
        numbers = (
            form.format(factor * figures[name]) for name, (_, factor, form) in columns.items()
        )
        report.add_row(figures['module'], '\n'.join(figures['members']), *numbers)
    return report


def as_json(plan: GraspPlan, robot: Robot) -> dict[str, Any]:
    """Return a plan as data for JSON; values that are not finite become null."""
    miss = plan.closest_violation
    return {
        'robot': robot.name,
        'roller_names': list(robot.roller_names),
        'grasps': [export_figures(grasp) | export_path(grasp) for grasp in plan.grasps],
        'complete': plan.complete,
        'closest_violation': None
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


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
