"""Fig. 7: three configurations that grasp one object, found by the program."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from isotruss_ros.core import (
    analyze_grasp,
    Cylinder,
    GraspAnalysis,
    GraspRequirements,
    load_robot,
    plan_grasps,
    PlannedGrasp,
    Progress,
    SolverError,
)
from isotruss_ros.core.grasp_lines import deformed_lines, member_lines
from isotruss_ros.paper.figure_7_drawing import draw
from isotruss_ros.paper.item import Advance, Item, Report
from isotruss_ros.paper.tables import number, Table
import numpy as np

#: The object, free inside the loop of one tube, and the modules of that loop.
CYLINDER = Cylinder((0.5, 0.3), 0.35)
MODULES = ('north/P', 'north/R', 'north/Z')
#: Coefficient between tube and object.
FRICTION = 0.5
#: Of the contact points, closer than the search has them: contact lengths are counted in them [m].
SPACING = 0.001


@dataclass(frozen=True)
class Held:
    """
    One way of holding the object.

    :ivar plan: what the search found.
    :ivar analysis: of the grasp, with close contact points.
    :ivar deflection: of the tubes, largest, across them [m].
    :ivar spacing: of the contact points [m].
    """

    plan: PlannedGrasp
    analysis: GraspAnalysis
    deflection: float
    spacing: float = SPACING


def compute(advance: Advance) -> Sequence[Held]:
    """Search for the best grasp at each module of the loop."""
    robot = load_robot('nine_member')
    held = []
    for done, module in enumerate(MODULES):

        def tell(progress: Progress, done: int = done) -> None:
            advance((done + 0.9 * progress.share) / len(MODULES))

        needs = GraspRequirements(friction=FRICTION, module=module, count=1)
        plan = plan_grasps(robot.home, CYLINDER, needs, on_progress=tell, thorough=False)
        if not plan.grasps:
            raise SolverError(f'no grasp at module {module}: {plan.nearest_miss}')
        held.append(_hold(plan.grasps[0]))
        advance((done + 1) / len(MODULES))
    return held


def _hold(plan: PlannedGrasp) -> Held:
    analysis = analyze_grasp(plan.config, CYLINDER, FRICTION, spacing=SPACING)
    start, end = member_lines(plan.config).T[:, :, None]
    axis = (end - start) / np.abs(end - start)
    across = ((deformed_lines(plan.config, analysis) - start) * axis.conj()).imag
    return Held(plan, analysis, float(np.abs(across).max()))


def report(held: Sequence[Held]) -> Report:
    """Return what differs between the three."""
    stiffness = np.array([np.diag(each.analysis.stiffness)[:2] for each in held])
    ratios = stiffness.max(axis=0) / stiffness.min(axis=0)
    forces = [float(each.analysis.normal_forces.sum()) for each in held]
    return Report(
        heading='Fig. 7: three configurations that grasp one object',
        picture='Above, three shapes of the nine-member robot around the same disc in the same '
        'place; below, each grasp magnified: contact forces and regions, the bent tubes, and '
        'dashed where they were',
        stated='A nine-member robot can take several configurations to grasp an object of one '
        'size in one place. Each has its own contact forces, contact regions, deformation and '
        'grasp stiffness, so that stiffness can be chosen without moving the object. One '
        'grasp is magnified, with its force and the length of its contact. No numbers are in '
        'the text.',
        computed=f'An object of {100 * CYLINDER.diameter:g} cm at '
        f'({CYLINDER.center[0]:g}, {CYLINDER.center[1]:g}) m, free inside one loop of the robot '
        'at home. `core.plan_grasps` finds a configuration for a grip at each of the three '
        'modules of the loop. The grasp stiffness differs by a factor of '
        f'{number(float(ratios[0]), 2)} along x and {number(float(ratios[1]), 2)} along y; the '
        f'tubes press with {number(min(forces), 2)} to {number(max(forces), 2)} N in all. The '
        'dotted squares are magnified below: forces on the object, friction included (15 mm '
        'per N), regions of contact, the bent tubes to scale, and dashed where they were.',
        difference='All that the paper says to differ does; all are closed by friction '
        f"({FRICTION:g}). Configurations, object and numbers are ours, since the figure's "
        'are not in the text.',
        assumption='The configurations are what the search finds, none is placed by hand; '
        "friction and the place of the object are chosen. Stiffness is the paper's: object and "
        'contact points displaced together. The model is linear: where tubes move by centimetres '
        'its forces are estimates.',
        tables=(_grasps(held),),
    )


def _grasps(held: Sequence[Held]) -> Table:
    rows = []
    for each in held:
        analysis = each.analysis
        kx, ky, kt = np.diag(analysis.stiffness)
        lengths = ' + '.join(number(1e3 * length) for length in analysis.contact_lengths.values())
        rows.append(
            (
                each.plan.grasp.module,
                ', '.join(analysis.contact_lengths),
                number(float(analysis.normal_forces.sum())),
                lengths,
                number(1e3 * each.deflection, 2),
                number(float(kx)),
                number(float(ky)),
                number(float(kt)),
                number(each.plan.required_friction, 2),
                number(each.plan.travel, 2),
            )
        )
    headings = (
        'grip',
        'members in contact',
        'normal forces [N]',
        'contact [mm]',
        'tubes moved by [mm]',
        'stiffness x [N/m]',
        'stiffness y [N/m]',
        'stiffness turning [N m]',
        'friction needed',
        'roller travel [m]',
    )
    return Table('figure_7', 'The three grasps', headings, rows)


ITEM = Item('figure_7', compute, report, draw)
