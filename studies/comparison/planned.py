# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Planned grasps: from the free object to the squeeze, and along Fig. 9."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from isotruss_ros.core import ConvexObject, GraspRequirements, plan_grasps
from isotruss_ros.core.paths.object_path import ObjectPath
from isotruss_ros.core.paths.path_tracking import (
    FINISHED,
    PathPhase,
    PathTracker,
    RETURN_SETTINGS,
    RETURN_SPEED,
    RETURN_TURN_RATE,
)
from isotruss_ros.core.planning.grasp_plan import export_path, PlannedGrasp
from isotruss_ros.core.servo.servo_settings import SqueezeSettings
from isotruss_ros.demo.path import figure_9
from isotruss_ros.mujoco_plant.options import PlantOptions
from isotruss_ros.mujoco_plant.plant import MujocoPlant
import numpy as np
from pressed_plants import mesh, round_robot
from studies.comparison.carrying import carry, RATE, Regulated
from studies.comparison.section import Check, Section
from studies.paper.tables import number, Table

FRICTION = 0.5
#: Rest at the end [s].
REST = 3.0
#: Ratio of the duration to the planner's [-].
SLOWER = 2.0
#: Load that the servo expects [N].
LOAD = 5.0
#: Friction force of the object on the ground [N].
GROUND = 0.5


@dataclass(frozen=True)
class Wanted:
    """Requirements of a planned grasp."""

    center: tuple[float, float]  #: initial centre of the object [m]
    diameter: float  #: diameter of the object [m]
    module: str  #: grasping module
    squeeze: float  #: normal force of each member [N]


class Closed(NamedTuple):
    """Result of closing members on an object."""

    squeeze: float  #: mean normal force of the members [N]
    planned: float  #: planned squeeze [N]
    away: float  #: distance of the object from its planned position [m]


#: Requirements of the grasps. The first is that of the demonstration, whose object is carried.
WANTED = (
    Wanted((0.6, 0.3), 0.2, 'north/Z', 22.0),
    Wanted((0.6, 0.3), 0.3, 'north/Z', 15.0),
    Wanted((0.7, 0.4), 0.16, 'north/Z', 20.0),
)


def compare(wanted: Sequence[Wanted] = WANTED) -> Section:
    """
    Follow planned grasps in MuJoCo.

    :param wanted: requirements of the grasps; the object of the first is carried along Fig. 9.
    """
    rows: list[tuple[str, ...]] = []
    closed: list[Closed] = []
    returned: list[Closed] = []
    carried = []
    for number_, each in enumerate(wanted):
        grasp = _plan(each)
        plant = follow(each, grasp)
        closed.append(_measure(plant, grasp))
        bring_back(_regulated(plant, each, grasp), each.center)
        returned.append(_measure(plant, grasp))
        if number_ == 0:
            carried.append(carry(_regulated(plant, each, grasp), figure_9()))
        x, y = each.center
        rows.append(
            (
                f'({x:g}, {y:g})',
                number(1e3 * each.diameter),
                each.module,
                number(grasp.squeeze),
                number(closed[-1].squeeze),
                number(1e3 * closed[-1].away, 2),
                number(returned[-1].squeeze),
                number(1e3 * returned[-1].away, 2),
            )
        )
    (arc,) = carried
    why = 'the rollers follow the path open loop, and the object moves in MuJoCo'
    back = 'the servo controls the squeeze of our model; the path ends within 1.25 mm'
    return Section(
        'Planned grasps',
        'A free object lies on the ground with a friction force of half a newton. MuJoCo’s '
        'rollers follow the path of `plan_grasps` to a given squeeze in open loop, at half the '
        'planned speed. This displaces the object. As in `pick_object`, the path follower '
        f'then returns it to its initial place at {1e3 * RETURN_SPEED:g} mm/s. The object of the '
        'first row is then carried along the path of Fig. 9. '
        f'It is {"lost" if arc.lost else "held"} to the end of the arc, within '
        f'{number(1e3 * arc.position_error, 2)} mm of the path, with a squeeze between '
        f'{number(float(arc.squeezes.min()))} and {number(float(arc.squeezes.max()))} N and an '
        f'`expected_load` of {LOAD:g} N.',
        (
            *_checks('open loop', closed, (10.0, 4.0), why),
            *_checks('brought back', returned, (10.0, 2.0), back),
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
                    'squeeze planned [N]',
                    'open loop: squeeze [N]',
                    'object displaced [mm]',
                    'brought back: squeeze [N]',
                    'object displaced [mm]',
                ),
                rows,
            ),
        ),
    )


def _regulated(plant: MujocoPlant, wanted: Wanted, grasp: PlannedGrasp) -> Regulated:
    settings = SqueezeSettings(wanted.squeeze, load=LOAD)
    return Regulated(plant, grasp.config.robot, grasp.grip, settings)


def _measure(plant: MujocoPlant, grasp: PlannedGrasp) -> Closed:
    squeeze = 0.5 * sum(force.normal for force in plant.contact_forces().values())
    away = float(np.hypot(*np.subtract(plant.object_pose()[:2], grasp.grip.body.pose[:2])))
    return Closed(squeeze, grasp.squeeze, away)


def _checks(
    how: str, closed: Sequence[Closed], bounds: tuple[float, float], why: str
) -> Iterator[Check]:
    """Return the checks of squeeze and position with their bounds [%, mm]."""
    off = max(abs(each.squeeze / each.planned - 1.0) for each in closed)
    away = max(each.away for each in closed)
    yield Check(f'squeeze after closing in place, {how}', 100.0 * off, bounds[0], '%', why)
    yield Check(f'place after closing in place, {how}', 1e3 * away, bounds[1], 'mm', 'as above')


def _plan(wanted: Wanted) -> PlannedGrasp:
    robot = round_robot()
    needs = GraspRequirements(
        friction=FRICTION, module=wanted.module, squeeze=wanted.squeeze, count=1
    )
    cylinder = ConvexObject.disc(wanted.center, wanted.diameter)
    plan = plan_grasps(robot.home, cylinder, needs, thorough=False)
    return plan.grasps[0]


def follow(wanted: Wanted, grasp: PlannedGrasp) -> MujocoPlant:
    """
    Return a plant after the path of the rollers to a grasp.

    :param wanted: requirements of the grasp.
    :param grasp: planned grasp.
    """
    robot, exported = round_robot(), export_path(grasp)
    cylinder = ConvexObject.disc(wanted.center, wanted.diameter)
    options = PlantOptions(friction=FRICTION, ground_friction=GROUND)
    plant = MujocoPlant(robot, cylinder, options, mesh(robot, grasp.members))
    path, times = np.array(exported['path']), SLOWER * np.array(exported['times'])
    for k in range(int(np.ceil(times[-1] * RATE))):
        goal = [np.interp((k + 1) / RATE, times, column) for column in path.T]
        plant.advance(1.0 / RATE, RATE * (np.array(goal) - plant.travel))
    plant.settle(REST)
    return plant


def bring_back(steering: Regulated, center: tuple[float, float]) -> PathPhase:
    """
    Move a held object back to its initial pose, like `pick_object`; return the final phase.

    :param steering: servo with squeeze control.
    :param center: initial centre of the object [m].
    """
    plant, cycle = steering.plant, 1.0 / RATE
    here = plant.object_pose()
    path = ObjectPath([here, (*center, 0.0)], RETURN_SPEED, RETURN_TURN_RATE)
    tracker, phase = PathTracker(path, RETURN_SETTINGS, cycle), PathPhase.FOLLOWING
    while phase not in FINISHED:
        tracking = tracker.update(plant.object_pose(), 0.0, cycle)
        phase, twist = tracking.phase, tracking.twist
        plant.advance(cycle, steering.command(twist, np.zeros(3)))
    plant.settle(REST)
    return phase
