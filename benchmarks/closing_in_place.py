# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What closing in place does to a free object on the elastic plant.

Random free objects inside a loop of the nine-member robot at home; each is grasped by the path
that `plan_grasps` finds. It is driven on the elastic plant, where nothing but the robot holds the
object.

    python benchmarks/closing_in_place.py [number of objects]
"""

from __future__ import annotations

from dataclasses import dataclass
import itertools
import math
import os
import sys

os.environ.update(OPENBLAS_NUM_THREADS='1', OMP_NUM_THREADS='1')  # before NumPy comes in

from grasp_planner import objects
from isotruss_ros.core import (
    ConvexObject,
    ElasticObject,
    GraspRequirements,
    load_robot,
    plan_grasps,
    RollerFaults,
    SimulatedRobot,
)
from isotruss_ros.core.planning.grasp_plan import PlannedGrasp
from measuring import part, print_machine, print_table
import numpy as np

ROBOT = load_robot('nine_member')
FRICTION, PARTS = 0.5, 20


@dataclass
class Driven:
    """What the plant came to at the end of a path."""

    plant: SimulatedRobot
    item: ElasticObject

    def moved(self, body: ConvexObject) -> float:
        """Return how far the object is from where it lay [m]."""
        return math.dist(self.plant.object_pose[:2], body.pose[:2])


def drive(grasp: PlannedGrasp, body: ConvexObject) -> Driven:
    """Drive the elastic plant along a planned path."""
    item = ElasticObject(body, FRICTION)
    plant = SimulatedRobot(ROBOT.home, item, RollerFaults())
    for begin, end in itertools.pairwise(grasp.path):
        plant.command((end - begin) / PARTS)
        for _ in range(PARTS):
            plant.advance(1.0)
    return Driven(plant, item)


def row(name: str, bodies: list[ConvexObject], needs: GraspRequirements) -> list[str]:
    """Return what became of the best grasps by two members."""
    moved, squeezes, margins, held = [], [], [], 0
    for body in bodies:
        plan = plan_grasps(ROBOT.home, body, needs)
        grasp = next((found for found in plan if len(found.members) == 2), None)
        if grasp is None:
            continue
        driven = drive(grasp, body)
        moved.append(1e3 * driven.moved(body))
        held += driven.item.grasp is not None
        found = 0.0 if driven.item.grasp is None else driven.item.grasp.squeeze
        squeezes.append(100.0 * found / grasp.squeeze)
        margins.append(driven.item.slip_margin)
    return [
        name,
        f'{len(moved)} / {len(bodies)}',
        f'{held}',
        f'{np.median(moved):.2f} / {max(moved):.2f}',
        f'{np.median(squeezes):.1f} / {min(squeezes):.1f}',
        f'{np.median(margins):.2f}',
    ]


def main() -> None:
    """Print the table."""
    print_machine()
    bodies = objects(int(sys.argv[1]) if len(sys.argv) > 1 else part(20))
    header = [
        'path',
        'found',
        'held',
        'moved, median / worst [mm]',
        'squeeze, median / least [%]',
        'margin [N]',
    ]
    needs = GraspRequirements(friction=FRICTION, count=2)
    print_table(header, [row('closing in place', bodies, needs)])


if __name__ == '__main__':
    main()
