# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fig. 7: three configurations that grasp one object, found by the planner."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from isotruss_ros.core import ConvexObject, GraspRequirements, load_robot, plan_grasps
from isotruss_ros.core.errors import SolverError
from isotruss_ros.core.kinematics.depths import member_lines
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.planning.grasp_plan import PlannedGrasp, Progress
from isotruss_ros.core.planning.requirements import Measure
import numpy as np
from studies.paper.item import Advance, Report
from studies.paper.tables import number, Table

#: The object, free inside the loop of one tube.
BODY = ConvexObject.disc((0.5, 0.3), 0.35)
#: Driven modules of the loop, and the measure of the ranking at each. The passive module P is
#: excluded, because it cannot roll the object.
SEARCHES = (
    ('north/Z', Measure.SLIP_MARGIN),
    ('north/Z', Measure.TOTAL_FORCE),
    ('north/R', Measure.SLIP_MARGIN),
)
#: Coefficient of friction between tube and object [-].
FRICTION = 0.5


@dataclass(frozen=True)
class Held:
    """
    One grasp of the object.

    :ivar plan: planned grasp.
    :ivar deflection: largest transverse deflection of a tube [m].
    """

    plan: PlannedGrasp
    deflection: float

    @property
    def stiffness(self) -> Array:
        """Return the stiffness (3, 3) of the grasp [N/m, N, N m]."""
        return self.plan.equilibrium.response.stiffness


def compute(advance: Advance) -> Sequence[Held]:
    """Search for the best grasps at the driven modules of the loop."""
    robot = load_robot('nine_member')
    held: list[Held] = []
    for done, (module, measure) in enumerate(SEARCHES):

        def tell(progress: Progress, done: int = done) -> None:
            advance((done + 0.9 * progress.share) / len(SEARCHES))

        needs = GraspRequirements(friction=FRICTION, module=module, count=1, measure=measure)
        plan = plan_grasps(robot.home, BODY, needs, on_progress=tell, thorough=False)
        if not plan.grasps:
            raise SolverError(f'no grasp at module {module}: {plan.closest_violation}')
        held.append(_hold(plan.grasps[0]))
        advance((done + 1) / len(SEARCHES))
    return held


def _hold(plan: PlannedGrasp) -> Held:
    start, end = member_lines(plan.config).T[:, :, None]
    axis = (end - start) / np.abs(end - start)
    across = ((plan.equilibrium.member_lines()[1] - start) * axis.conj()).imag
    return Held(plan, float(np.abs(across).max()))


def report(held: Sequence[Held]) -> Report:
    """Return text and table with the differences between the three grasps."""
    stiffness = np.array([np.diag(each.stiffness)[:2] for each in held])
    ratios = stiffness.max(axis=0) / stiffness.min(axis=0)
    forces = [each.plan.total_force for each in held]
    lengths = [1e3 * x for each in held for x in each.plan.equilibrium.patches.lengths.tolist()]
    used = [each.plan.utilisation for each in held]
    return Report(
        heading='Fig. 7: three configurations that grasp one object',
        picture='Above, three shapes of the robot around the same disc in the same place; below, '
        'each grasp magnified: forces on the object, friction included, regions of contact, bent '
        'tubes, and dashed the tubes without load',
        stated='A nine-member robot grasps one object in one place in several configurations, '
        'each with its own contact forces, regions, deformation and stiffness.',
        computed=f'An object of {100 * 2.0 * BODY.arm:g} cm at '
        f'({BODY.pose.x:g}, {BODY.pose.y:g}) m, free inside one loop. '
        '`core.plan_grasps` finds two configurations at one driven module of the loop (best by '
        'slip margin, and best by force), and one at the other module. Their stiffnesses '
        f'differ by a factor of {number(float(ratios[0]), 2)} along x and '
        f'{number(float(ratios[1]), 2)} along y. The sum of the normal forces is '
        f'{number(min(forces), 2)} to {number(max(forces), 2)} N, evenly distributed over '
        f'{number(min(lengths), 2)} to {number(max(lengths), 2)} mm of each tube. The largest '
        f'moment is {number(max(used), 2)} of the wrinkling moment.',
        difference='Forces, regions, deformation and stiffness differ, as in the paper. All '
        f'grasps hold the free object by friction ({FRICTION:g}). The numbers are those of '
        '`settle_grasp`, with bent and flattened tubes.',
        assumption='Friction and the place of the object are chosen. Where tubes move by '
        'centimetres, the forces are less accurate. The search keeps moments '
        'below 0.8 of the wrinkling moment.',
        tables=(_grasps(held),),
    )


def _grasps(held: Sequence[Held]) -> Table:
    rows = []
    for each in held:
        patches, (kx, ky, kt) = each.plan.equilibrium.patches, np.diag(each.stiffness)
        lengths = ' + '.join(number(1e3 * length, 2) for length in patches.lengths.tolist())
        pressures = ' + '.join(
            number(1e-3 * pressure, 3) for pressure in patches.pressures.tolist()
        )
        rows.append(
            (
                each.plan.module,
                ', '.join(each.plan.members),
                number(each.plan.total_force),
                lengths,
                pressures,
                number(each.plan.utilisation, 2),
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
        'pressure of contact [kPa]',
        'moment / wrinkling moment',
        'tubes moved by [mm]',
        'stiffness x [N/m]',
        'stiffness y [N/m]',
        'stiffness turning [N m]',
        'friction needed',
        'roller travel [m]',
    )
    return Table('figure_7', 'The three grasps', headings, rows)
