"""What the demonstration prints: how the object moved, and how it was held."""

from __future__ import annotations

from collections.abc import Sequence

from isotruss_msgs.action import PlanGrasp
from isotruss_msgs.msg import GraspState
from isotruss_ros.demo.record import PhaseRecord
from isotruss_ros.nodes.messages import seconds
import numpy as np
from rich.table import Table


def plan_table(plan: PlanGrasp.Result) -> Table:
    """Return the grasps that were found, best first; the first is the one that is gone to."""
    table = Table(
        title=(
            f'Planned: {plan.evaluations} configurations looked at, {plan.analyses} analysed, '
            f'{plan.computing_time:.1f} s'
        ),
        box=None,
        pad_edge=False,
        collapse_padding=True,
    )
    table.add_column('grip')
    table.add_column('touching')
    for heading in ('margin\nmN', 'needs\nfriction', 'normal\nN', 'way\nm', 'least\nrigidity'):
        table.add_column(heading, justify='right', no_wrap=True)
    for grasp in plan.grasps:
        table.add_row(
            grasp.module,
            ' '.join(grasp.members),
            f'{1e3 * grasp.closure_margin:.0f}',
            f'{grasp.required_friction:.2f}',
            f'{grasp.total_force:.1f}',
            f'{grasp.travel:.2f}',
            f'{grasp.rigidity:.2f}',
        )
    return table


def motion_table(records: Sequence[PhaseRecord]) -> Table:
    """Return how far the object came, and how exactly."""
    table = Table(
        title='Object: dx, dy in mm and turn in degrees; roller: largest speed of any',
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
    """Return what held the object: forces over each phase, the rest at its end."""
    table = Table(
        title='Grasp: sum of the normal forces; left: what friction does not balance',
        caption=(
            'Closed where it was gripped. Moved from there the sides press unevenly:\n'
            'what friction leaves, the simulator holds.'
        ),
        box=None,
        pad_edge=False,
        collapse_padding=True,
    )
    table.add_column('phase')
    for heading in (
        'normal N\nfrom - to',
        'at the\nend N',
        'in contact\nmm',
        'left\nN',
        'closed\n%',
        'at the\nend',
        'analysis\nms',
        'states\nHz',
    ):
        table.add_column(heading, justify='right', no_wrap=True)
    for record in records:
        answers = [grasp for grasp in record.grasps if grasp.code == GraspState.OK]
        if not answers:
            table.add_row(record.name, 'no answer')
            continue
        forces = [normal_force(grasp) for grasp in answers]
        last = answers[-1]
        closed = np.mean([grasp.force_closure for grasp in record.grasps])
        table.add_row(
            record.name,
            f'{min(forces):.1f} - {max(forces):.1f}',
            f'{forces[-1]:.1f}',
            ' + '.join(f'{1e3 * length:.0f}' for length in last.contact_lengths),
            f'{last.closure_residual:.1f}',
            f'{100.0 * closed:.0f}',
            'closed' if last.force_closure else 'open',
            f'{1e3 * np.median([grasp.computing_time for grasp in answers]):.1f}',
            f'{_rate(answers):.0f}',
        )
    return table


def normal_force(grasp: GraspState) -> float:
    """Return the sum of the normal forces [N]."""
    return sum(contact.normal_force for contact in grasp.contacts)


def _rate(states: Sequence[GraspState]) -> float:
    """Return how many states came per second; 0 if there is only one."""
    span = seconds(states[-1].header) - seconds(states[0].header)
    return (len(states) - 1) / span if span > 0.0 else 0.0
