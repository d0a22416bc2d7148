"""The tables of the demonstration: planned grasps, motion of the object, measured grasp."""

from __future__ import annotations

from collections.abc import Sequence

from isotruss_msgs.action import PlanGrasp
from isotruss_msgs.msg import GraspState
from isotruss_ros.demo.record import PhaseRecord
import numpy as np
from rich.table import Table


def plan_table(plan: PlanGrasp.Result) -> Table:
    """Return the planned grasps, best first; the robot takes the first."""
    table = Table(
        title=(
            f'Planned: {plan.evaluations} configurations evaluated, {plan.analyses} of them '
            f'by statics, in {plan.computing_time:.1f} s'
        ),
        box=None,
        pad_edge=False,
        collapse_padding=True,
    )
    table.add_column('module')
    table.add_column('grasping members')
    for heading in (
        'margin\nmN',
        'required\nfriction',
        'normal\nN',
        'wrinkling\n%',
        'travel\nm',
        'least\nrigidity',
    ):
        table.add_column(heading, justify='right', no_wrap=True)
    for grasp in plan.grasps:
        table.add_row(
            grasp.module,
            ' '.join(grasp.members),
            f'{1e3 * grasp.closure_margin:.0f}',
            f'{grasp.required_friction:.2f}',
            f'{grasp.total_force:.1f}',
            f'{100.0 * grasp.utilisation:.0f}',
            f'{grasp.travel:.2f}',
            f'{grasp.rigidity:.2f}',
        )
    return table


def motion_table(records: Sequence[PhaseRecord]) -> Table:
    """Return how far the object moved, and the errors."""
    table = Table(
        title='Object: dx, dy in mm and rotation in degrees; roller: largest speed of any',
        box=None,
        pad_edge=False,
        collapse_padding=True,
    )
    table.add_column('phase')
    for heading in (
        'commanded',
        'measured',
        'error\nmm',
        'error\ndeg',
        'roller\nmm/s',
        'loop\nHz',
    ):
        table.add_column(heading, justify='right', no_wrap=True)
    unit = np.array([1e3, 1e3, np.rad2deg(1.0)])
    for record in records:
        table.add_row(
            record.name,
            _numbers(unit * record.commanded),
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
    """Return forces and wrinkling over each phase, and how the object is held at its end."""
    table = Table(
        title=(
            'Grasp: sum of the normal forces; mean contact pressure; largest bending moment\n'
            'against the wrinkling moment; smallest wrench at which a contact slips'
        ),
        caption=(
            'shift: of the object to its equilibrium, where members of unequal length\n'
            'press it; the kinematic simulator moves it as if they were rigid'
        ),
        box=None,
        pad_edge=False,
        collapse_padding=True,
    )
    table.add_column('phase', no_wrap=True)
    for heading in (
        'normal N\nfrom - to',
        'contact\nmm',
        'pressure\nkPa',
        'wrinkling\n%',
        'slips\nat N',
        'shift\nmm',
        'held\n%',
        'analysis\nms',
    ):
        table.add_column(heading, justify='right', no_wrap=True)
    for record in records:
        analyses = [grasp for grasp in record.grasps if grasp.code <= GraspState.WRINKLED]
        if not analyses:
            table.add_row(record.name, 'no analysis')
            continue
        forces = [normal_force(grasp) for grasp in analyses]
        last = analyses[-1]
        table.add_row(
            record.name,
            f'{min(forces):.1f} - {max(forces):.1f}',
            ' + '.join(f'{1e3 * length:.0f}' for length in last.contact_lengths),
            ' + '.join(f'{1e-3 * pressure:.0f}' for pressure in last.contact_pressures),
            f'{100.0 * max(max(grasp.utilisation) for grasp in analyses):.0f}',
            f'{last.slip_margin:.1f}',
            f'{1e3 * float(np.hypot(*last.displacement[:2])):.1f}',
            f'{100.0 * np.mean([grasp.held for grasp in record.grasps]):.0f}',
            f'{1e3 * np.median([grasp.computing_time for grasp in analyses]):.1f}',
        )
    return table


def normal_force(grasp: GraspState) -> float:
    """Return the sum of the normal forces [N]."""
    return sum(contact.normal_force for contact in grasp.contacts)
