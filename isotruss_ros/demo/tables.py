# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables that the demonstration prints: planned grasps, motion, held object and contacts."""

from __future__ import annotations

from collections.abc import Sequence

from isotruss_msgs.action import PlanGrasp
from isotruss_ros.demo.record import PhaseRecord
from isotruss_ros.viewer.arrows import arrow_of
import numpy as np
from rich.table import Table


def make_table(
    title: str, names: Sequence[str], figures: Sequence[str], wrap: bool = False
) -> Table:
    """Return a table with headings and without rows."""
    table = Table(title=title, box=None, pad_edge=False, collapse_padding=True)
    for heading in names:
        table.add_column(heading, no_wrap=not wrap)
    for heading in figures:
        table.add_column(heading, justify='right', no_wrap=True)
    return table


def plan_table(plan: PlanGrasp.Result) -> Table:
    """Return a table of the planned grasps, best first; the robot executes the first."""
    table = make_table(
        f'Plan: {plan.evaluations} configurations evaluated, {plan.analyses} of them '
        f'by statics, in {plan.computing_time:.1f} s',
        ('module', 'grasping members'),
        ('squeeze\nN', 'slips\nat N', 'wrinkling\n%', 'travel\nm', 'least\nrigidity'),
        wrap=True,
    )
    for grasp in plan.grasps:
        table.add_row(
            grasp.module,
            ' '.join(grasp.members),
            f'{grasp.squeeze:.1f}',
            f'{grasp.slip_margin:.1f}',
            f'{100.0 * grasp.utilisation:.0f}',
            f'{grasp.travel:.2f}',
            f'{grasp.rigidity:.2f}',
        )
    return table


def motion_table(records: Sequence[PhaseRecord]) -> Table:
    """Return a table of the object's displacement and errors in each phase."""
    table = make_table(
        'Object: displacement in mm and rotation in degrees by executed twists and as measured, '
        'and their difference; largest roller speed; rate of the control loop',
        ('phase',),
        ('executed', 'measured', 'error\nmm', 'error\ndeg', 'roller\nmm/s', 'loop\nHz'),
    )
    unit = np.array([1e3, 1e3, np.rad2deg(1.0)])
    for record in records:
        table.add_row(
            record.name,
            _numbers(unit * record.accepted),
            _numbers(unit * record.measured),
            f'{1e3 * record.position_error:.3f}',
            f'{np.rad2deg(record.angle_error):.3f}',
            f'{1e3 * record.max_roller_speed:.1f}',
            f'{record.loop_rate:.0f}',
        )
    return table


def _numbers(values: np.ndarray) -> str:
    return ' '.join(f'{round(value, 1) + 0.0:.1f}' for value in values)


def grasp_table(records: Sequence[PhaseRecord]) -> Table:
    """Return a table with the quality of the grasp in each phase, as ranges over all analyses."""
    table = make_table(
        'Grasp: fraction of analyses with a held object; mean normal\n'
        'force of a member; slip margin with its direction; largest\n'
        'used fraction of friction; contact lengths at the end; largest\n'
        'ratio of bending moment to wrinkling moment',
        ('phase',),
        (
            'held\n%',
            'squeeze\nN',
            'slips\nat N',
            'used\n%',
            'contact\nmm',
            'wrinkles\n%',
            'analysis\nms',
        ),
    )
    for record in records:
        analyses = record.analyses
        settled = [grasp for grasp in analyses if grasp.squeeze]
        if not settled:
            table.add_row(record.name, 'no analysis')
            continue
        squeezes = [np.mean(grasp.squeeze) for grasp in settled]
        last, weakest = analyses[-1], min(settled, key=lambda grasp: grasp.slip_margin)
        table.add_row(
            record.name,
            f'{100.0 * record.held_fraction:.0f}',
            f'{min(squeezes):.1f} - {max(squeezes):.1f}',
            f'{weakest.slip_margin:.1f} {arrow_of(weakest.slip_direction)}',
            f'{100.0 * max(max(grasp.friction_used) for grasp in settled):.0f}',
            ' + '.join(f'{1e3 * length:.0f}' for length in last.contact_lengths),
            f'{100.0 * max(max(grasp.utilisation) for grasp in settled):.0f}',
            f'{1e3 * np.median([grasp.computing_time for grasp in analyses]):.1f}',
        )
    return table


def contact_table(records: Sequence[PhaseRecord]) -> Table:
    """Return a table of the contact regions at the end of each phase."""
    table = make_table(
        'Contact regions of the held object at\nthe end of each phase: length, largest\n'
        'width, area, mean and largest pressure',
        ('phase', 'member'),
        ('length\nmm', 'width\nmm', 'area\ncm\u00b2', 'mean\nkPa', 'peak\nkPa'),
    )
    for record in records:
        if not record.analyses:
            table.add_row(record.name, 'no analysis')
            continue
        last = record.analyses[-1]
        for i, member in enumerate(last.contact_members):
            table.add_row(
                '' if i else record.name,
                member,
                f'{1e3 * last.contact_lengths[i]:.0f}',
                f'{1e3 * last.contact_widths[i]:.0f}',
                f'{1e4 * last.contact_areas[i]:.1f}',
                f'{1e-3 * last.contact_pressures[i]:.1f}',
                f'{1e-3 * last.peak_pressures[i]:.1f}',
            )
    return table
