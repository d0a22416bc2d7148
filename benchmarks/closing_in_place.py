# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What closing in place does to a free object on the elastic plant, and Fig. 9 after it.

Random free objects inside a loop of the nine-member robot at home; each is grasped by the path
that `plan_grasps` finds for a free object, and by the one for an object that the ground holds
while the members press on it, the only kind that closure (10) asks for. Both are driven on the
elastic plant, where nothing but the robot holds the object. Then the grasp of the demonstration
is squeezed in place, and carried along Fig. 9 by the rigid program in open loop and with the
squeeze regulated.

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
    analyze_grasp,
    ConvexObject,
    ElasticObject,
    GraspRequirements,
    Grip,
    load_robot,
    plan_grasps,
    RollerFaults,
    SimulatedRobot,
    TwistServo,
)
from isotruss_ros.core.control.inputs import RollerState, StampedInput
from isotruss_ros.core.control.squeeze_control import SqueezeControl, SqueezeSettings
from isotruss_ros.core.planning.grasp_plan import PlannedGrasp
from isotruss_ros.demo.path import figure_9
from measuring import print_machine, print_table
import numpy as np

ROBOT = load_robot('nine_member')
FRICTION, RATE, PARTS = 0.5, 50.0, 20
#: The grasp of the demonstration.
ITEM, MODULE, SQUEEZE = ConvexObject.disc((0.6, 0.3), 0.2), 'north/Z', 24.0


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


def opening(driven: Driven) -> float:
    """Return the angle between the members of the grip [deg]."""
    config, topology = driven.plant.config, ROBOT.topology
    i = ROBOT.module_names.index(MODULE)
    ahead = config.points[topology.c[topology.following[i]]] - config.points[topology.b[i]]
    back = config.points[topology.b[topology.previous[i]]] - config.points[topology.c[i]]
    return math.degrees(abs(np.angle(ahead / back)))


def squeeze_row(squeeze: float) -> list[str]:
    """Return what the grasp of the demonstration is like when it is squeezed so hard."""
    needs = GraspRequirements(friction=FRICTION, module=MODULE, squeeze=squeeze, count=1)
    driven = drive(plan_grasps(ROBOT.home, ITEM, needs, thorough=False)[0], ITEM)
    here = ITEM.moved_to(driven.plant.object_pose)
    analysis = analyze_grasp(driven.plant.config, here, FRICTION)
    return [
        f'{squeeze:g}',
        f'{driven.item.grasp.squeeze:.2f}',
        f'{opening(driven):.1f}',
        f'{1e3 * driven.moved(ITEM):.2f}',
        f'{driven.item.grasp.required_friction:.3f}',
        f'{driven.item.slip_margin:.2f}',
        f'{max(analysis.utilisation.values()):.2f}',
    ]


def figure_9_row(name: str, squeeze: float, pull: tuple[float, float, float] | None) -> list[str]:
    """Return how the grasp of the demonstration is carried along Fig. 9."""
    needs = GraspRequirements(friction=FRICTION, module=MODULE, squeeze=SQUEEZE, count=1)
    driven = drive(plan_grasps(ROBOT.home, ITEM, needs)[0], ITEM)
    plant, item = driven.plant, driven.item
    grip = Grip.at_module(ROBOT, MODULE, ITEM, FRICTION)
    servo = TwistServo(ROBOT, grip, 1.0 / RATE, timeout=1.0)
    if squeeze > 0.0:
        servo.squeeze = SqueezeControl(SqueezeSettings(squeeze))
    wanted, now = np.array(plant.object_pose), 0.0
    errors, squeezes, margins = [], [], []
    for phase in figure_9(pull):
        for k in range(round(phase.duration * RATE)):
            twist = phase.twist(k / RATE)
            item.external_wrench = phase.wrench(k / RATE)
            servo.twist = StampedInput(twist, now)
            state = RollerState(plant.roller_positions, plant.roller_velocities)
            servo.rollers = StampedInput(state, now)
            servo.pose = StampedInput(plant.object_pose, now)
            plant.command(servo.decide(now).command.roller_velocities)
            plant.advance(1.0 / RATE)
            now += 1.0 / RATE
            wanted += np.array(twist) / RATE
            if item.grasp is None:
                return [name, f'dropped in {phase.name}', '', '', '', '', '']
            errors.append(wanted - np.array(plant.object_pose))
            squeezes.append(item.grasp.squeeze)
            margins.append(item.slip_margin)
    apart = 1e3 * np.hypot(*np.array(errors)[:, :2].T)
    turned = np.degrees(np.abs(np.array(errors)[:, 2]))
    return [
        name,
        'held',
        f'{apart.max():.2f}',
        f'{apart[-1]:.3f}',
        f'{turned.max():.2f}',
        f'{min(squeezes):.1f} - {max(squeezes):.1f}',
        f'{min(margins):.2f}',
    ]


def main() -> None:
    """Print the tables."""
    print_machine()
    bodies = objects(int(sys.argv[1]) if len(sys.argv) > 1 else 20)
    free = GraspRequirements(friction=FRICTION, count=2)
    fast = GraspRequirements(friction=FRICTION, min_margin=0.0, count=2)
    header = [
        'path',
        'found',
        'held',
        'moved, median / worst [mm]',
        'squeeze, median / least [%]',
        'margin [N]',
    ]
    print_table(
        header,
        [
            row('closing in place', bodies, free),
            row('for an object that the ground holds', bodies, fast),
        ],
    )
    print()
    header = ['planned [N]', 'squeeze', 'opening [deg]', 'moved [mm]', 'friction', 'margin [N]']
    print_table(
        [*header, 'wrinkling'], [squeeze_row(squeeze) for squeeze in (2.0, 5.0, 10.0, 20.0, 24.0)]
    )
    print()
    header = ['Fig. 9', '', 'worst [mm]', 'end [mm]', 'worst [deg]', 'squeeze [N]', 'margin [N]']
    pull = (0.0, -5.0, 0.0)
    print_table(
        header,
        [
            figure_9_row('rigid, open loop', 0.0, None),
            figure_9_row('squeeze regulated', SQUEEZE, None),
            figure_9_row('rigid, 5 N in the arc', 0.0, pull),
            figure_9_row('regulated, 5 N in the arc', SQUEEZE, pull),
        ],
    )


if __name__ == '__main__':
    main()
