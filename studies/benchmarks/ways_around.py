# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Paths of a held object to random goals around obstacles and limits of the robot.

Goals are sorted by the straight line: it leads to the goal, is refused because of a post, or is
refused because of the robot's own limits. A path of two legs avoids each post. Around limits,
start and goal are ends of random legs from home. The found paths are followed in the elastic plant
by the control loop with its squeeze control and `PathTracker`; a path is *carried* if its end is
reached.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
import time
from typing import NamedTuple

from isotruss_ros.core import (
    ConvexObject,
    ElasticObject,
    ObjectPath,
    Obstacle,
    PathTracker,
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
from isotruss_ros.core.paths.path_tracking import (
    FINISHED,
    PathPhase,
    speed_share,
    TrackingSettings,
)
from isotruss_ros.core.planning.foresee_path import foresee_path, SPEED, TURN_RATE
from isotruss_ros.core.planning.path_tree import Node, PathTree
from isotruss_ros.core.planning.plan_path import search_path
from isotruss_ros.core.servo.servo_settings import ServoSettings, SqueezeSettings
import numpy as np
from studies.benchmarks.measuring import part, Table
from studies.comparison.rooms import clearance, random_room
from studies.comparison.walks import ROBOT

FRICTION, DIAMETER, DEPTH = 0.8, 0.3, 0.02
MODULE = 'north/Z'
#: Largest displacements of a goal from the start at home [m, rad].
NEAR, FAR = np.array([0.3, 0.3, 0.6]), np.array([0.6, 0.6, 1.2])
#: Number of posts that are tried for a goal, and number of random legs [-].
POSTS, LEGS = 8, 2
#: Fraction of a leg that is taken, so that its end has a margin to the limits [-].
LEG_SHARE = 0.8
#: Smallest clearance at the start [m].
LEAST_CLEARANCE = 0.023
PERIOD = 0.01


class Task(NamedTuple):
    """Goal of a held object in a room."""

    held: HeldGrip  #: equilibrium at the start
    goal: Array  #: (3,) desired pose [m, rad]
    room: Sequence[Obstacle]  #: obstacles


def begin() -> HeldGrip:
    """Return a held disc of the robot at home."""
    center = tangent_center(ROBOT.home, MODULE, DIAMETER, DEPTH)
    body = ConvexObject.disc(center, DIAMETER, FRICTION)
    return settle_grasp(ROBOT.home, body).equilibrium


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


def around_post(rng: np.random.Generator, home: HeldGrip) -> Task | None:
    """Return a goal behind a post that a path of two legs avoids; None if there is none."""
    begin = np.array(home.pose)
    via, goal = begin + FAR * rng.uniform(-1.0, 1.0, (2, 3))
    if not reaches(home, goal) or not reaches(home, via, goal):
        return None
    for _ in range(POSTS):
        place = begin + rng.uniform(0.3, 0.7) * (goal - begin) + rng.uniform(-0.2, 0.2, 3)
        post = ConvexObject.disc(tuple(place[:2]), float(rng.uniform(0.04, 0.12)))
        room = [Obstacle('post', post)]
        is_near = clearance(home, room) < LEAST_CLEARANCE
        if is_near or make_tree(home, goal, room).find_collision(goal):
            continue
        if reaches(home, goal, room=room) or not reaches(home, via, goal, room=room):
            continue
        return Task(home, goal, room) if is_refused(home, goal, room) else None
    return None


def is_refused(held: HeldGrip, goal: Array, room: Sequence[Obstacle]) -> bool:
    """Return whether `foresee_path` refuses the straight line to a pose."""
    return bool(foresee_path(held, FRICTION, np.array([held.pose, goal]), obstacles=room).why)


def random_end(rng: np.random.Generator, home: HeldGrip) -> Node:
    """Return the end of random legs, before the limits at which the last one may end."""
    tree = make_tree(home, np.array(home.pose))
    node = tree.root
    for _ in range(LEGS):
        target = np.array(home.pose) + FAR * rng.uniform(-1.0, 1.0, 3)
        end = tree.move(node, target)
        node = tree.move(node, (1.0 - LEG_SHARE) * node.poses[-1] + LEG_SHARE * end.poses[-1])
    return node


def around_limits(rng: np.random.Generator, home: HeldGrip) -> Task | None:
    """Return an end of random legs, and the start at another one; None if a line joins them."""
    start, goal = random_end(rng, home), random_end(rng, home).poses[-1]
    tree = PathTree(start.rolling, goal, ())
    if tree.reaches(tree.move(tree.root, goal), goal):
        return None
    foresight = foresee_path(home, FRICTION, np.array(start.poses))
    held = foresight.grips[-1]
    if foresight.why or not is_refused(held, goal, ()):
        return None
    return Task(held, goal, ())


def straight(rng: np.random.Generator, home: HeldGrip) -> Task | None:
    """Return a goal to which a straight line leads in a room with three obstacles."""
    room, goal = random_room(rng, home, 3), np.array(home.pose) + NEAR * rng.uniform(-1.0, 1.0, 3)
    return Task(home, goal, room) if reaches(home, goal, room=room) else None


#: Functions that make the goals, and the number of goals [-], by the reason of the refusal.
KINDS = {'straight': straight, 'obstacle': around_post, 'robot': around_limits}
GOALS = {'straight': part(30), 'obstacle': part(15), 'robot': part(15)}


def tasks(held: HeldGrip, kind: str, count: int) -> Iterator[Task]:
    """Yield random goals of a kind."""
    rng, number = np.random.default_rng(11), 0
    while number < count:
        task = KINDS[kind](rng, held)
        if task is not None:
            number += 1
            yield task


def carry(held: HeldGrip, poses: Array, room: Sequence[Obstacle]) -> bool:
    """Return whether the control loop carries the object along a path in the elastic plant."""
    plant = SimulatedRobot(held.config, ElasticObject(held.body, FRICTION), RollerFaults())
    plant.advance(0.0)
    squeeze = SqueezeSettings(held.squeeze)
    body = replace(held.body, mass=0.5)
    grip = replace(held.touching(FRICTION), body=body)
    settings = ServoSettings(grip, PERIOD, 0.2, squeeze=squeeze, obstacles=tuple(room))
    servo = TwistServo(ROBOT, settings)
    poses = poses - poses[0] + np.array(plant.object_pose)
    path = ObjectPath(poses, SPEED, TURN_RATE)
    tracker, scale = PathTracker(path, TrackingSettings(), PERIOD), 1.0
    for cycle in range(int(5.0 * path.duration / PERIOD) + 1000):
        now, pose = cycle * PERIOD, plant.object_pose
        tracking = tracker.update(pose, 0.0, PERIOD, scale)
        if tracking.phase in FINISHED:
            return tracking.phase is PathPhase.REACHED
        state = RollerState(plant.roller_positions, plant.roller_velocities)
        servo.receive(
            twist=StampedInput(tracking.twist, now),
            rollers=StampedInput(state, now),
            pose=StampedInput(pose, now),
        )
        command = servo.decide(now).command
        scale = speed_share(command.status, command.scale)
        plant.command(command.roller_velocities)
        plant.advance(PERIOD)
    return False


def tables() -> Iterator[Table]:
    """Yield the table of the case."""
    home, rows = begin(), []
    for kind, count in GOALS.items():
        spent, found, carried, steps = [], 0, 0, []
        for task in tasks(home, kind, count):
            began = time.thread_time()
            plan = search_path(task.held, FRICTION, task.goal, task.room)
            spent.append(time.thread_time() - began)
            steps.append(plan.steps)
            if not plan.why:
                found += 1
                carried += carry(task.held, plan.poses, task.room)
        numbers = count, found, carried, f'{np.median(spent):.1f}', f'{max(spent):.1f}'
        rows.append([kind, *map(str, numbers), str(max(steps))])
    header = ('refused by', 'goals', 'found', 'carried', 'median [s]', 'longest [s]', 'most steps')
    yield Table('', header, rows)
