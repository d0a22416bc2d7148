"""Planned grasps: from the free object to the squeeze, and on to the end of Fig. 9's arc."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from comparison.carrying import carry, Regulated
from comparison.grips import round_robot
from comparison.section import Check, Section
from isotruss_ros.core import Cylinder, GraspRequirements, plan_grasps, PlannedGrasp
from isotruss_ros.core.planning.export import export_path
from isotruss_ros.demo.path import figure_9
from isotruss_ros.mujoco_plant.options import PlantOptions
from isotruss_ros.mujoco_plant.plant import MujocoPlant
import numpy as np
from paper.tables import number, Table

FRICTION = 0.5
#: Commands per second, and rest at the end [s].
RATE, REST = 50.0, 3.0
#: The path takes so much longer than at the speed of the planner.
SLOWER = 2.0
#: What holds the object to the ground while it lies there [N].
GROUND = 0.5


@dataclass(frozen=True)
class Wanted:
    """
    A grasp to be planned.

    :ivar center: where the object lies [m].
    :ivar diameter: of it [m].
    :ivar module: that is to grip.
    :ivar squeeze: normal force of each member [N].
    """

    center: tuple[float, float]
    diameter: float
    module: str
    squeeze: float


#: The first one is that of the demonstration, which is carried on.
WANTED = (
    Wanted((0.6, 0.3), 0.2, 'north/Z', 24.0),
    Wanted((0.6, 0.3), 0.3, 'north/Z', 15.0),
    Wanted((0.7, 0.4), 0.16, 'north/Z', 20.0),
)


def compare(wanted: Sequence[Wanted] = WANTED) -> Section:
    """
    Follow planned grasps in MuJoCo.

    :param wanted: the grasps; the first one is carried on along Fig. 9.
    """
    rows, squeezes, places, carried = [], [], [], []
    for number_, each in enumerate(wanted):
        grasp = _plan(each)
        plant = follow(each, grasp)
        forces = plant.contact_forces()
        squeeze = 0.5 * sum(force.normal for force in forces.values())
        pose = plant.object_pose()
        away = float(np.hypot(*np.subtract(pose[:2], grasp.grasp.center)))
        squeezes.append(abs(squeeze / grasp.squeeze - 1.0))
        places.append(away)
        x, y = each.center
        rows.append(
            (
                f'({x:g}, {y:g})',
                number(1e3 * each.diameter),
                each.module,
                number(squeeze),
                number(grasp.squeeze),
                number(1e3 * away, 2),
            )
        )
        if number_ == 0:
            steering = Regulated(grasp.config, grasp.grasp, each.squeeze, FRICTION)
            carried.append(carry(plant, steering, figure_9()))
    (arc,) = carried
    why = 'tubes give by a centimetre under the squeeze: our structure is linear'
    return Section(
        'Planned grasps',
        'An object lies free, held to the ground by half a newton; `plan_grasps` finds a grasp '
        'with a given squeeze, and the rollers of MuJoCo’s robot follow its path to the end, open '
        'loop, in twice the time of the planner. In that time itself, where the robot has masses, '
        'a member that lags hits the object before the other one is there, and the first object '
        'ends 5 mm off; with nothing that held it to the ground it would be pushed away. Then the '
        'first grasp, that of the demonstration, is carried along Fig. 9 by the servo, which '
        'regulates the squeeze: '
        f'{"lost" if arc.lost else "held"} to the end of the arc, at most '
        f'{number(1e3 * arc.position_error, 2)} mm from it, the squeeze between '
        f'{number(float(arc.squeezes.min()))} and {number(float(arc.squeezes.max()))} N.',
        (
            Check('squeeze after closing in place', 100.0 * max(squeezes), 10.0, '%', why),
            Check('place after closing in place', 1e3 * max(places), 4.0, 'mm', 'the same'),
            Check(
                'planned grasp carried to the end of the arc',
                1e3 * arc.position_error,
                2.0,
                'mm',
                'as with the squeeze regulated above',
            ),
        ),
        (
            Table(
                'planned',
                'At the end of the path to the grasp',
                (
                    'object at [m]',
                    'diameter [mm]',
                    'module',
                    'squeeze MuJoCo [N]',
                    'planned [N]',
                    'from the planned place [mm]',
                ),
                rows,
            ),
        ),
    )


def _plan(wanted: Wanted) -> PlannedGrasp:
    robot = round_robot()
    needs = GraspRequirements(
        friction=FRICTION, module=wanted.module, squeeze=wanted.squeeze, count=1
    )
    cylinder = Cylinder(wanted.center, wanted.diameter)
    plan = plan_grasps(robot.home, cylinder, needs, thorough=False)
    return plan.grasps[0]


def follow(wanted: Wanted, grasp: PlannedGrasp) -> MujocoPlant:
    """
    Return a plant whose rollers have followed the path to a grasp.

    :param wanted: what was planned.
    :param grasp: the plan.
    """
    robot, exported = round_robot(), export_path(grasp)
    segments = np.full(len(robot.member_names), 4)
    segments[[robot.member_names.index(name) for name in grasp.members]] = 8
    cylinder = Cylinder(wanted.center, wanted.diameter)
    plant = MujocoPlant(
        robot, [cylinder], PlantOptions(friction=FRICTION, ground_friction=GROUND), segments
    )
    path, times = np.array(exported['path']), SLOWER * np.array(exported['times'])
    for k in range(int(np.ceil(times[-1] * RATE))):
        goal = [np.interp((k + 1) / RATE, times, column) for column in path.T]
        plant.advance(1.0 / RATE, RATE * (np.array(goal) - plant.travel))
    plant.settle(REST)
    return plant
