# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Clearance from obstacles, evasion of moving obstacles, and the time of a cycle with obstacles.

In a random room, obstacles are near a robot that holds a disc; twists change every two seconds.
Clearances are those of the true state after every cycle; the bound is 20 mm. A moving obstacle
crosses the room through the middle of the robot. It *reaches* the robot if the clearance becomes
negative; the robot says so before by a halt or by a status with its name. Grasps are planned of
the free discs of the case `grasp_planner`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
import math
import time
from typing import NamedTuple

from isotruss_ros.core import (
    ConvexObject,
    Disc,
    GraspRequirements,
    Grip,
    IsotrussError,
    load_robot,
    Obstacle,
    place_between,
    plan_grasps,
    Robot,
    RollingGrip,
    Status,
    tangent_center,
    TwistServo,
)
from isotruss_ros.core.inputs import RollerState, StampedInput
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.servo.servo_settings import ServoSettings, SqueezeSettings
from isotruss_ros.mujoco_plant.options import PlantOptions
from isotruss_ros.mujoco_plant.plant import MujocoPlant
import numpy as np
from rooms import clearance, Placed, random_room
from studies.benchmarks.grasp_planner import objects
from studies.benchmarks.measuring import part, Table
from studies.comparison.carrying import RATE, Regulated, squeeze_in
from walks import GRIPS, ROBOT, rolled

PERIOD, DURATION = 0.01, 30.0
BOUND = 0.02
#: Delay of the poses in MuJoCo [s], and standard deviations of the poses [m, rad].
DELAY, NOISE = 0.03, (1e-3, math.radians(0.5))
FRICTION = 0.8
#: In MuJoCo: depth of the object between the members [m], range of the smallest clearance at the
#: start [m], and number of twists [-].
DEPTH, NEAREST, NEAR, TWISTS = 0.02, 0.03, 0.06, 15
#: Robots of the random rooms, in turn.
ROBOTS = ('nine_member', 'triangle', 'nine_member', 'ring_of_four', 'bow_tie')


class Run(NamedTuple):
    """Result of a run in a room."""

    lowest: float  #: smallest clearance [m]
    statuses: Counter[Status]
    unnamed: int  #: cycles at rest under a twist without a name of a limit
    times: list[float]  #: processor times of the cycles [s]
    told: bool  #: whether a halt or a status named an obstacle before the smallest clearance


def hold(robot: Robot, module: str, diameter: float = 0.3) -> RollingGrip:
    """Return a disc at a module of the robot at home."""
    body = ConvexObject.disc(tangent_center(robot.home, module, diameter), diameter)
    return RollingGrip.attach(robot.home, Grip.at_module(robot, module, body))


def drive(
    held: RollingGrip,
    rng: np.random.Generator,
    duration: float,
    resting: Sequence[Obstacle] = (),
    moving: Sequence[Obstacle] = (),
    size: float = 0.1,
) -> Run:
    """Command random twists for a duration [s]; sensors are prompt and exact."""
    robot = held.config.robot
    servo = TwistServo(robot, ServoSettings(held.grip, PERIOD, 0.2, obstacles=tuple(resting)))
    velocities, statuses, lowest = np.zeros(len(robot.roller_names)), Counter(), math.inf
    times, unnamed, twist, told = [], 0, np.zeros(3), False
    for cycle in range(round(duration / PERIOD)):
        now = cycle * PERIOD
        if cycle % 200 == 0:
            twist = size * rng.standard_normal(3) * (1.0, 1.0, 4.0)
        state = RollerState(held.config.roller_positions, velocities)
        servo.receive(
            twist=StampedInput(twist, now),
            rollers=StampedInput(state, now),
            pose=StampedInput(held.pose, now),
        )
        if moving:
            seen = tuple(obstacle.at(now) for obstacle in moving)
            servo.receive(obstacles=StampedInput(seen, now))
        began = time.thread_time_ns()
        decision = servo.decide(now)
        times.append(1e-9 * (time.thread_time_ns() - began))
        command = decision.command
        statuses[command.status] += 1
        told |= 'obstacle' in decision.message
        unnamed += command.scale < 1e-4 and not decision.message and bool(twist.any())
        velocities = command.roller_velocities
        held = rolled(held, PERIOD * velocities)
        there = [obstacle.at(now + PERIOD) for obstacle in moving]
        lowest = min(lowest, clearance(held, [*resting, *there]))
    return Run(lowest, statuses, unnamed, times, told)


def crossing(rng: np.random.Generator, held: RollingGrip) -> Obstacle:
    """Return a disc of 0.1 to 0.2 m that crosses the robot at up to 0.2 m/s."""
    points = held.config.points
    middle, reach = points.mean(), np.abs(points - points.mean()).max()
    way, speed = np.exp(1j * rng.uniform(-np.pi, np.pi)), rng.uniform(0.05, 0.2)
    target = middle + 0.3 * reach * complex(*rng.uniform(-1.0, 1.0, 2))
    place, velocity = target - (1.2 * reach + 0.3) * way, speed * way
    shape = Disc(float(rng.uniform(0.1, 0.2)))
    pose = place.real, place.imag, 0.0
    return Obstacle('hand', ConvexObject(shape, pose), (velocity.real, velocity.imag, 0.0), 0.0)


def random_rooms() -> list[list[str]]:
    """Return a row for the random rooms of each robot."""
    runs: dict[str, list[Run]] = {}
    for seed in range(part(100)):
        name = ROBOTS[seed % len(ROBOTS)]
        robot, rng = load_robot(name), np.random.default_rng([seed, 5])
        modules = GRIPS if name == ROBOT.name else robot.module_names
        held = hold(robot, str(rng.choice(modules)))
        run = drive(held, rng, DURATION, random_room(rng, held, 3, BOUND + 1e-3))
        runs.setdefault(name, []).append(run)
    rows = []
    for name, of_robot in runs.items():
        statuses = sum((run.statuses for run in of_robot), Counter())
        halts = sum(count for status, count in statuses.items() if status >= 30)
        limited = statuses[Status.SLIDING] + statuses[Status.SLOWED_OBSTACLE]
        lowest = [run.lowest for run in of_robot]
        deepest = sum(clearance < BOUND - 1e-4 for clearance in lowest)
        unnamed = sum(run.unnamed for run in of_robot)
        cells = len(of_robot), f'{1e3 * min(lowest):.2f}', deepest, limited, halts, unnamed
        rows.append([name, *map(str, cells)])
    return rows


def moving_obstacles() -> list[list[str]]:
    """Return the rows of obstacles that cross the robot."""
    reached = told = halted = 0
    runs, lowest = part(50), math.inf
    for seed in range(runs):
        rng = np.random.default_rng([seed, 6])
        held = hold(ROBOT, str(rng.choice(GRIPS)))
        hand = crossing(rng, held)
        try:
            run = drive(held, rng, 20.0, moving=[hand], size=0.0)
        except IsotrussError:
            continue
        halted += bool(run.statuses[Status.HALT_OBSTACLE])
        if run.lowest < 0.0:
            reached += 1
            told += run.told
        else:
            lowest = min(lowest, run.lowest)
    return [[str(x) for x in (runs, halted, reached, told, f'{1e3 * lowest:.1f}')]]


class MujocoRun(NamedTuple):
    """Result of a run in a room in MuJoCo."""

    contacts: int  #: time steps in contact with an obstacle
    lowest: float  #: smallest clearance after a twist, with undeformed members [m]
    is_lost: bool  #: whether the object was lost
    statuses: Counter[Status]


def run_in_mujoco(seed: int) -> MujocoRun:
    """Command random twists in a room in MuJoCo, with noise and delayed poses."""
    rng, lowest = np.random.default_rng([seed, 9]), math.inf
    module = str(rng.choice(GRIPS))
    grip = place_between(ROBOT.home, members_at(ROBOT, module), Disc(0.3), 0.0, DEPTH)
    grip = replace(grip, body=replace(grip.body, friction=FRICTION, mass=0.5))
    held = RollingGrip.attach(ROBOT.home, grip)
    room = random_room(rng, held, 3, NEAREST)
    while clearance(held, room) > NEAR:
        room = random_room(rng, held, 3, NEAREST)
    options = PlantOptions(friction=FRICTION)
    plant = MujocoPlant(ROBOT, grip.body, options, obstacles=room)
    plant.hold_object(grip.body.pose)
    plant.settle(1.0)
    plant.release_object()
    plant.settle(1.0)
    squeeze = SqueezeSettings(squeeze_in(plant))
    loop = Regulated(plant, ROBOT, grip, squeeze, (*NOISE, rng), round(DELAY * RATE))
    loop.servo.apply(replace(loop.servo.settings, obstacles=tuple(room)))
    for _ in range(TWISTS):
        loop.run(2.0, 0.1 * rng.standard_normal(3) * (1.0, 1.0, 4.0))
        config = ROBOT.home.moved_to(plant.travel)
        lowest = min(
            lowest, clearance(Placed(config, grip.body.moved_to(plant.object_pose())), room)
        )
    is_lost, contacts = squeeze_in(plant) == 0.0, sum(plant.obstacle_contacts.values())
    return MujocoRun(contacts, lowest, is_lost, Counter(loop.statuses))


def mujoco_rooms() -> list[list[str]]:
    """Return the row of the rooms in MuJoCo."""
    runs = [run_in_mujoco(seed) for seed in range(part(20))]
    statuses = sum((run.statuses for run in runs), Counter())
    limited = statuses[Status.SLIDING] + statuses[Status.SLOWED_OBSTACLE]
    halts = sum(count for status, count in statuses.items() if status >= 30)
    contacts, lowest = sum(run.contacts for run in runs), min(run.lowest for run in runs)
    lost = sum(run.is_lost for run in runs)
    cells = len(runs), contacts, f'{1e3 * lowest:.1f}', limited, halts, lost
    return [[str(x) for x in cells]]


def planned_grasps() -> list[list[str]]:
    """Return the row of grasps of free discs between two obstacles."""
    bodies, found, by_obstacles, lowest = objects(part(50)), 0, 0, math.inf
    for seed, body in enumerate(bodies):
        rng = np.random.default_rng([seed, 10])
        room = random_room(rng, Placed(ROBOT.home, body), 2, BOUND + 1e-3)
        needs = GraspRequirements(count=1, obstacles=tuple(room))
        plan = plan_grasps(ROBOT.home, body, needs, thorough=False)
        for grasp in plan:
            places = (Placed(ROBOT.configuration(rollers), body) for rollers in grasp.path)
            lowest = min(lowest, *(clearance(place, room) for place in places))
        found += len(plan) > 0
        if not len(plan):
            by_obstacles += plan.closest_violation.requirement == 'obstacle_clearance'
    cells = len(bodies), found, f'{1e3 * lowest:.1f}', len(bodies) - found, by_obstacles
    return [[str(x) for x in cells]]


def cycle_times() -> list[list[str]]:
    """Return the rows of cycle times with several numbers of obstacles."""
    rows, base = [], 0.0
    for count in (0, 3, 20):
        times = []
        for seed in range(part(10)):
            rng = np.random.default_rng([seed, 7])
            held = hold(ROBOT, GRIPS[seed % len(GRIPS)])
            room = random_room(np.random.default_rng([seed, 8]), held, count, BOUND + 1e-3)
            times += drive(held, rng, 10.0, room).times[10:]
        mean = float(np.mean(times))
        base = base or mean
        peak = float(np.percentile(times, 99))
        cells = f'{1e3 * mean:.2f}', f'{mean / base:.2f}', f'{1e3 * peak:.2f}'
        rows.append([str(count), *cells])
    return rows


def tables() -> Iterator[Table]:
    """Yield the tables of the case."""
    header = ('robot', 'rooms', 'smallest clearance [mm]', 'rooms below 19.9 mm')
    header += ('cycles limited', 'cycles halted', 'cycles at rest without a name')
    yield Table('Three obstacles at rest', header, random_rooms())
    header = ('rooms', 'time steps in contact', 'smallest clearance [mm]')
    header += ('cycles limited', 'cycles halted', 'objects lost')
    title = 'MuJoCo: modules of 1 kg, noise of 1 mm and 0.5 degrees, poses 30 ms late'
    yield Table(title, header, mujoco_rooms())
    header = (
        'runs',
        'halted',
        'reached',
        'told of these',
        'smallest clearance of the others [mm]',
    )
    yield Table('A moving obstacle, up to 0.2 m/s', header, moving_obstacles())
    header = ('discs', 'grasps', 'smallest clearance of their paths [mm]', 'without a grasp')
    header += ('of these: obstacle named',)
    yield Table('Grasps between two obstacles', header, planned_grasps())
    header = ('obstacles', 'mean [ms]', 'relative', '99 % [ms]')
    yield Table('Time of a cycle', header, cycle_times())
