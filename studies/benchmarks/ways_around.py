# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Paths of a held object to random goals around obstacles and limits of the robot.

Goals are sorted by the straight line: it leads to the goal, is refused because of a post, or is
refused because of the robot's own limits. A path of two legs avoids each post. Around limits,
start and goal are ends of random legs of two robots; the control loop reaches the goal from home.
The found paths are followed by the control loop with its squeeze control and `PathServo` in the
elastic plant (cycles of 40 ms), and some also in MuJoCo with modules of 1 kg (cycles of 20 ms).
Measured poses are exact. A path is *carried* if its end is reached without a contact with an
obstacle.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
import functools
import time
from typing import NamedTuple

from isotruss_ros.core import (
    ConvexObject,
    ElasticObject,
    load_robot,
    ObjectPath,
    Obstacle,
    RollerFaults,
    settle_grasp,
    SimulatedRobot,
    tangent_center,
    TwistServo,
)
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.inputs import RollerState, StampedInput
from isotruss_ros.core.manipulation.rolling_grip import RollingGrip
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.paths.path_servo import PathOutcome, PathServo, ServoFeedback
from isotruss_ros.core.paths.path_tracking import TrackingSettings
from isotruss_ros.core.planning.foresee_path import foresee_path, SPEED, TURN_RATE
from isotruss_ros.core.planning.path_tree import Node, PathTree
from isotruss_ros.core.planning.plan_path import search_path
from isotruss_ros.core.servo.servo_settings import ServoSettings, SqueezeSettings
from isotruss_ros.mujoco_plant.driven_robot import DrivenRobot
from isotruss_ros.mujoco_plant.options import PlantOptions
import numpy as np
from rooms import clearance, random_room
from studies.benchmarks.measuring import part, SHARE, Table
from walks import GRIPS, ROBOT

FRICTION, DIAMETER, DEPTH, MASS = 0.8, 0.3, 0.02, 0.5
#: Modules at which an object can be moved to the limits of a second robot.
RING, RING_GRIPS = load_robot('ring_of_four'), ('east/L', 'east/E', 'north/M', 'west/N')
#: Largest displacements of a goal from the start at home, and of a random leg [m, rad].
NEAR, FAR, LONG = np.array([0.3, 0.3, 0.6]), np.array([0.6, 0.6, 1.2]), np.array([1.2, 1.2, 3.5])
#: Number of posts that are tried for a goal, and number of random legs [-].
POSTS, LEGS = 8, 2
#: Fractions of a leg that are taken to a start and to a goal, so that its end has a margin to the
#: limits [-].
START_SHARE, GOAL_SHARE = 0.85, 0.98
#: Smallest clearance at the start [m].
LEAST_CLEARANCE = 0.023
#: Periods of the control loop in the elastic plant and in MuJoCo, and largest age of inputs [s].
PERIOD, MUJOCO_PERIOD, TIMEOUT = 0.04, 0.02, 0.2


class Task(NamedTuple):
    """Goal of a held object in a room."""

    held: HeldGrip  #: equilibrium at the start
    goal: Array  #: (3,) desired pose [m, rad]
    room: Sequence[Obstacle]  #: obstacles


@functools.cache
def begin(name: str, module: str) -> HeldGrip:
    """Return a disc that a robot holds at home."""
    robot = ROBOT if name == ROBOT.name else RING
    body = ConvexObject.disc(tangent_center(robot.home, module, DIAMETER, DEPTH), DIAMETER)
    return settle_grasp(robot.home, replace(body, friction=FRICTION, mass=MASS)).equilibrium


def any_grip(rng: np.random.Generator, name: str = ROBOT.name) -> HeldGrip:
    """Return a disc that a robot holds at home at a random module."""
    return begin(name, str(rng.choice(GRIPS if name == ROBOT.name else RING_GRIPS)))


def reaches(held: HeldGrip, *poses: Array, room: Sequence[Obstacle] = ()) -> bool:
    """Return whether straight legs lead to the last pose, by the kinematics of the search."""
    tree = make_tree(held, poses[-1], room)
    node = tree.root
    for pose in poses:
        node = tree.move(node, pose)
        if not tree.reaches(node, pose):
            return False
    return True


def make_tree(held: HeldGrip, goal: Array, room: Sequence[Obstacle] = ()) -> PathTree:
    """Return a tree at an equilibrium."""
    return PathTree(RollingGrip.attach(held.config, held.touching(FRICTION)), goal, room)


def around_post(rng: np.random.Generator) -> Task | None:
    """Return a goal behind a post that a path of two legs avoids; None if there is none."""
    home = any_grip(rng)
    begin = np.array(home.pose)
    via, goal = begin + FAR * rng.uniform(-1.0, 1.0, (2, 3))
    if not reaches(home, goal) or not reaches(home, via, goal):
        return None
    for _ in range(POSTS):
        place = begin + rng.uniform(0.3, 0.7) * (goal - begin) + rng.uniform(-0.1, 0.1, 3)
        post = ConvexObject.disc(tuple(place[:2]), float(rng.uniform(0.04, 0.12)))
        room = [Obstacle('post', post)]
        is_near = clearance(home, room) < LEAST_CLEARANCE
        if is_near or make_tree(home, goal, room).find_collision(goal):
            continue
        if reaches(home, via, goal, room=room) and is_refused(home, goal, room=room):
            return Task(home, goal, room)
    return None


def is_refused(held: HeldGrip, *poses: Array, room: Sequence[Obstacle] = ()) -> bool:
    """Return whether `foresee_path` refuses straight legs to poses."""
    path = np.array([held.pose, *poses])
    return bool(foresee_path(held, FRICTION, path, obstacles=room).why)


def random_end(rng: np.random.Generator, home: HeldGrip, share: float) -> Node:
    """Return the end of random legs, of each of which a share up to the limits is taken."""
    tree = make_tree(home, np.array(home.pose))
    node = tree.root
    for _ in range(LEGS):
        end = tree.move(node, np.array(home.pose) + LONG * rng.uniform(-1.0, 1.0, 3))
        node = tree.move(node, (1.0 - share) * node.poses[-1] + share * end.poses[-1])
    return node


def around_limits(rng: np.random.Generator) -> Task | None:
    """Return ends of random legs as start and goal; None if a straight line joins them."""
    home = any_grip(rng, ROBOT.name if rng.integers(4) > 0 else RING.name)
    start, end = random_end(rng, home, START_SHARE), random_end(rng, home, GOAL_SHARE)
    goal, tree = end.poses[-1], make_tree(home, end.poses[-1])
    if tree.reaches(tree.move(start, goal), goal):
        return None
    config, grip = start.rolling.config, start.rolling.grip
    settled = settle_grasp(config, grip.body, FRICTION, members=grip.members)
    if not settled.held or not is_refused(settled.equilibrium, goal):
        return None
    # The control loop must reach the goal from home.
    if is_refused(home, *end.poses[1:]):
        return None
    return Task(settled.equilibrium, goal, ())


def straight(rng: np.random.Generator) -> Task | None:
    """Return a goal to which a straight line leads in a room with three obstacles."""
    home = any_grip(rng)
    room, goal = random_room(rng, home, 3), np.array(home.pose) + NEAR * rng.uniform(-1.0, 1.0, 3)
    return Task(home, goal, room) if reaches(home, goal, room=room) else None


#: Numbers of the random goals. They are stored, because most numbers have no goal with a post or
#: around limits.
STRAIGHT = (*range(7), *range(8, 22), *range(23, 26), *range(27, 33))
POST = (95, 618, 1037, 1071, 1245, 1697, 2057, 2065, 2114, 2136, 2441, 2613, 3610, 3918, 4669)
LIMITS = (28, 46, 143, 169, 171, 262, 375, 442, 468, 507, 563, 625, 780, 818, 883)
#: Functions that draw the goals, their seed and numbers, and how many of them are carried in
#: MuJoCo as well [-], by the reason of the refusal.
KINDS = {
    'nothing': (straight, 11, STRAIGHT, part(10)),
    'obstacle': (around_post, 11, POST, round(10 * SHARE)),
    'robot': (around_limits, 13, LIMITS, 0),
}


def tasks(kind: str) -> Iterator[Task]:
    """Yield the goals of a kind; a change of the search may remove some."""
    draw, seed, numbers, _ = KINDS[kind]
    for number in numbers[: part(len(numbers))]:
        task = draw(np.random.default_rng([seed, number]))
        if task is not None:
            yield task


def carry(
    plant: SimulatedRobot | DrivenRobot, held: HeldGrip, poses: Array, room: Sequence[Obstacle]
) -> str:
    """
    Follow a path of the object by the control loop; return the reason of a failure.

    :param held: equilibrium at the start of the path.
    """
    period = MUJOCO_PERIOD if isinstance(plant, DrivenRobot) else PERIOD
    grip, squeeze = held.touching(FRICTION), SqueezeSettings(held.squeeze)
    settings = ServoSettings(grip, period, TIMEOUT, squeeze=squeeze, obstacles=tuple(room))
    servo = TwistServo(held.config.robot, settings)
    servo.memory = replace(servo.memory, config=held.config)
    path = ObjectPath(poses - poses[0] + np.array(plant.object_pose), SPEED, TURN_RATE)
    tracking = PathServo(period, TIMEOUT, servo.inputs)
    for cycle in range(int(5.0 * path.duration / period) + 1000):
        now = cycle * period
        state = RollerState(plant.roller_positions, plant.roller_velocities)
        servo.receive(rollers=StampedInput(state, now), pose=StampedInput(plant.object_pose, now))
        if not cycle:
            tracking.begin(path, TrackingSettings(), now)
        step = tracking.decide(now)
        if step.outcome is not None:
            break
        servo.receive(twist=StampedInput(step.tracking.twist, now))
        decision = servo.decide(now)
        command, words = decision.command, decision.message
        feedback = ServoFeedback(command.status, command.scale, words, decision.frequency)
        servo.inputs.servo_feedback = StampedInput(feedback, now)
        plant.command(command.roller_velocities)
        plant.advance(period)
    if isinstance(plant, DrivenRobot) and (touched := plant.plant.obstacle_contacts):
        return f'contact with {dict(touched)}'
    return '' if step.outcome is PathOutcome.REACHED else step.message or 'out of time'


class Result(NamedTuple):
    """Result of the search for a path, and of its carries."""

    time: float  #: processor time of the search [s]
    steps: int  #: steps of the search [-]
    why: str  #: reason if no path was found
    lost: str  #: reason if the object was not carried in the elastic plant
    lost_in_mujoco: str | None  #: the same in MuJoCo; None if it was not tried there


def try_task(task: Task, in_mujoco: bool) -> Result:
    """Search for a path, and follow it in the elastic plant and in MuJoCo."""
    began = time.thread_time()
    plan = search_path(task.held, FRICTION, task.goal, task.room)
    spent = time.thread_time() - began
    if plan.why:
        return Result(spent, plan.steps, plan.why, '', None)
    faults, body = RollerFaults(), task.held.body
    plant = SimulatedRobot(task.held.config, ElasticObject(body, FRICTION), faults)
    plant.advance(0.0)
    lost = carry(plant, task.held, plan.poses, task.room)
    if not in_mujoco:
        return Result(spent, plan.steps, '', lost, None)
    robot, options = task.held.config.robot, PlantOptions(friction=FRICTION)
    driven = DrivenRobot(robot, body, False, options, faults, obstacles=task.room)
    lost_in_mujoco = carry(driven, task.held, plan.poses, task.room)
    return Result(spent, plan.steps, '', lost, lost_in_mujoco)


def tables() -> Iterator[Table]:
    """Yield the table of the case."""
    rows = []
    for kind, (_, _, _, driven) in KINDS.items():
        results = [try_task(task, number < driven) for number, task in enumerate(tasks(kind))]
        found = [result for result in results if not result.why]
        tried = [result for result in found if result.lost_in_mujoco is not None]
        times = [result.time for result in results]
        numbers = len(results), len(found), sum(not result.lost for result in found)
        carried = sum(not result.lost_in_mujoco for result in tried)
        cells = *map(str, numbers), f'{carried} of {len(tried)}', f'{np.median(times):.1f}'
        steps = max(result.steps for result in results)
        rows.append([kind, *cells, f'{max(times):.1f}', str(steps)])
    header = ('refused by', 'goals', 'found', 'carried', 'in MuJoCo', 'median [s]', 'longest [s]')
    yield Table('', (*header, 'most steps'), rows)
