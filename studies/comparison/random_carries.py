# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random discs and boxes that the package's control loop carries along random paths."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from isotruss_ros.core import (
    ConvexObject,
    Disc,
    Grip,
    HoldStatus,
    place_between,
    Polygon,
    Robot,
    Status,
)
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.grip_record import GripRecord
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.planning.foresee_path import foresee_grip
from isotruss_ros.core.servo.servo_settings import SqueezeSettings
from isotruss_ros.mujoco_plant.options import PlantOptions
from isotruss_ros.mujoco_plant.plant import MujocoPlant
import numpy as np
from pressed_plants import hold_at_home, round_robot
from studies.comparison.carrying import RATE, rates, Regulated, squeeze_in
from studies.comparison.section import Check, Section
from studies.paper.tables import number, Table
from wedge import MODULE

FRICTION, INDENTATION = 0.8, 0.01
#: Standard deviations of the measured poses [m, rad].
NOISE = (1e-3, np.radians(0.5))
#: Number of legs of a path [-], time [s] and largest step of a leg [m, rad].
LEGS, LEG_TIME, REACH = 2, 3.0, np.array([0.04, 0.04, 0.12])
#: Rest before and after the path [s], and largest time of a slowed leg relative to its time [-].
REST, LONGEST = 1.0, 3.0
#: Number of cycles at the end, whose median squeeze is that of a carry [-].
LAST = 20
#: Smallest slip margin of a carry [N], largest utilisation of the tubes at home [-], which changes
#: along the path, and pull relative to the slip margin [-].
LEAST_MARGIN, MOST_USED, PULL = 0.5, 0.9, 0.5
#: Position error at which an object has left its path [m].
OFF = 0.02
DISC, BOX = 'discs', 'boxes'
PULLED = 'pulled'


def _in_mujoco(**options: float) -> Callable[[Robot, ConvexObject], MujocoPlant]:
    """Return a function that makes a MuJoCo plant at rest with an object in the grip."""

    def make(robot: Robot, body: ConvexObject) -> MujocoPlant:
        settings = PlantOptions(friction=FRICTION, **options)
        return hold_at_home(robot, body, members_at(robot, MODULE), settings)

    return make


#: Plants by name; each differs from modules of 1 kg, an object of 0.5 kg and ideal rollers.
PLANTS: Mapping[str, Callable[[Robot, ConvexObject], MujocoPlant]] = {
    'as planned': _in_mujoco(),
    PULLED: _in_mujoco(),
    'floor 2 N a joint': _in_mujoco(module_friction=2.0),
    'rollers lag 0.05 s': _in_mujoco(roller_lag=0.05),
    'rollers of 20 N': _in_mujoco(roller_force=20.0),
}
ENDS = ('arrived', 'halted, held', 'refused', 'lost, reported', 'lost, not reported')


@dataclass(frozen=True)
class Outcome:
    """
    Result of one object's carry.

    :ivar error: position error relative to the executed twists, a second after the path [m]; NaN
        without motion.
    """

    end: str  #: result, one of `ENDS`
    error: float
    squeeze: float  #: ratio of the plant's final squeeze to the desired one [-]


def compare_discs(count: int = 20) -> Section:
    """
    Carry discs.

    :param count: number of objects.
    """
    words = (
        f'{count} discs of 0.1 to 0.3 m are pressed into the corner at home by '
        f'{1e3 * INDENTATION:.0f} mm with a coefficient of friction of {FRICTION:g} and a '
        f'utilisation of at most {MOST_USED:g}. Each '
        f'is carried along {LEGS} random straight legs of up to {1e3 * REACH[0]:.0f} mm and '
        f'{REACH[2]:g} rad, each in {LEG_TIME:g} s or more, with a noise of the poses of '
        f'{1e3 * NOISE[0]:g} mm and {np.degrees(NOISE[1]):.1f}°. In the row “{PULLED}”, '
        f'external forces of {PULL:g} times the slip margin act for half of a leg. '
        f'The control loop first holds the object for {REST:g} s, and refuses a path on which its '
        'model predicts a loss. “Halted, held”: the control loop stopped while the object was '
        'held; “reported”: the control loop reported the loss. “Off [mm]” is the final distance '
        'from the position to which the executed twists lead, “squeeze off” the final deviation '
        'of the squeeze. An object that is lost before the control starts is replaced.'
    )
    return _compare(DISC, count, words)


def compare_boxes(count: int = 20) -> Section:
    """
    Carry boxes.

    :param count: number of objects.
    """
    return _compare(BOX, count, f'{count} boxes are carried in the same way as the discs.')


def _compare(kind: str, count: int, words: str) -> Section:
    robot = round_robot()
    found = {name: [run(robot, kind, seed, name) for seed in range(count)] for name in PLANTS}
    silent = sum(one.end == ENDS[-1] for outcomes in found.values() for one in outcomes)
    return Section(
        f'Random {kind} carried',
        words,
        (Check(f'{kind} lost, not reported', silent, 0.0, '', ''),),
        (_table(kind, found),),
    )


def _table(kind: str, found: Mapping[str, Sequence[Outcome]]) -> Table:
    rows = []
    for name, outcomes in found.items():
        counts = [sum(one.end == end for one in outcomes) for end in ENDS]
        held = [one for one in outcomes if one.end in ENDS[:2]]
        errors = [1e3 * one.error for one in held] or [np.nan]
        squeezes = [abs(100.0 * (one.squeeze - 1.0)) for one in held] or [np.nan]
        values = (np.median(errors), max(errors), np.median(squeezes))
        rows.append((name, *map(str, counts), *(number(float(value), 2) for value in values)))
    headings = ('plant', *ENDS, 'off, median [mm]', 'off, worst [mm]', 'squeeze off, median [%]')
    return Table(f'random_{kind}', kind.capitalize(), headings, rows)


def run(robot: Robot, kind: str, seed: int, name: str) -> Outcome:
    """
    Carry one object.

    :param robot: robot with round tubes, at home.
    :param kind: kind of the object.
    :param seed: seed of object, path, pull and noise.
    :param name: name of the plant.
    """
    rng = np.random.default_rng(seed)
    while True:
        grip, held = draw_grip(robot, kind, rng)
        steps = rng.uniform(-1.0, 1.0, (LEGS, 3)) * REACH
        direction = rng.uniform(0.0, 2.0 * np.pi)
        plant = PLANTS[name](robot, grip.body)
        if squeeze_in(plant):
            break
    settings = SqueezeSettings(held.squeeze)
    steering = Regulated(plant, robot, grip, settings, (*NOISE, seed))
    goal = np.array(plant.object_pose())
    for _ in range(round(REST * RATE)):
        steering.step(np.zeros(3))
    if _is_refused(steering, grip, steps):
        return Outcome('refused', np.nan, np.nan)
    size = PULL * held.slip_margin(FRICTION) if name == PULLED else 0.0
    pull = size * np.array([np.cos(direction), np.sin(direction), 0.0])
    return _carry(steering, goal, steps, pull)


def _is_refused(steering: Regulated, grip: Grip, steps: Array) -> bool:
    """Return whether the loop's model predicts a loss on legs (n, 3), as the path follower."""
    belief, config = steering.control.tracker.belief, steering.servo.robot.home
    if belief is None:
        return False
    config = config.moved_to(steering.plant.travel)
    poses = belief.pose + np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    record = GripRecord.of(belief.held)
    ahead = foresee_grip(config, grip.body.moved_to(poses[0]), FRICTION, poses, record)
    return ahead is not None and bool(ahead.why)


def draw_grip(robot: Robot, kind: str, rng: np.random.Generator) -> tuple[Grip, HeldGrip]:
    """
    Return a grip of an object at home, with its equilibrium.

    :param robot: robot with round tubes, at home.
    :param kind: kind of the object.
    :param rng: random number generator.
    """
    members = members_at(robot, MODULE)
    while True:
        if kind == DISC:
            shape: Disc | Polygon = Disc(rng.uniform(0.1, 0.3))
        else:
            x, y = 0.5 * rng.uniform(0.1, 0.3, 2)
            shape = Polygon([(-x, -y), (x, -y), (x, y), (-x, y)], corner_radius=0.02)
        angle = rng.uniform(0.0, np.pi)
        try:
            body = place_between(robot.home, members, shape, angle, INDENTATION).body
            body = replace(body, mass=0.5)
            held = attach_grip(robot.home, body)
        except GraspError:
            continue
        if held.hold(FRICTION) is not HoldStatus.HELD:
            continue
        used = float(held.sections.used.max())
        if held.slip_margin(FRICTION) > LEAST_MARGIN and used < MOST_USED:
            return Grip(members, body, FRICTION), held


def _carry(steering: Regulated, goal: Array, legs: Array, pull: Array) -> Outcome:
    """Carry the object along legs from rest to rest; return the result."""
    plant, speeds = steering.plant, rates(LEG_TIME)
    arrived = True
    for number_of_leg, leg in enumerate(legs):
        done, cycles = 0.0, 0
        while arrived and done < len(speeds):
            pulled = number_of_leg == 0 and 0.25 <= done / len(speeds) < 0.75
            plant.pull(pull if pulled else np.zeros(3))
            twist = leg / LEG_TIME * speeds[int(done)]
            steering.step(twist)
            goal = goal + steering.scale * twist / RATE
            done, cycles = done + steering.scale, cycles + 1
            arrived = cycles < LONGEST * len(speeds)
    plant.pull(np.zeros(3))
    squeezes = []
    for _ in range(round(REST * RATE)):
        steering.step(np.zeros(3))
        squeezes.append(squeeze_in(plant))
    error = float(np.hypot(*(goal - np.array(plant.object_pose()))[:2]))
    # MuJoCo's collision detection can miss a contact in a single step.
    squeeze = float(np.median(squeezes[-LAST:])) / steering.servo.settings.squeeze.force
    if squeeze == 0.0 or error > OFF:
        halted = max(steering.statuses) >= Status.HALT_NO_TWIST
        return Outcome(ENDS[3] if halted else ENDS[4], error, squeeze)
    return Outcome(ENDS[0] if arrived else ENDS[1], error, squeeze)
