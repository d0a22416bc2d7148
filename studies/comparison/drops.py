# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random grasps, loads and motions: no object may be lost if its slip margin exceeds the load."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from isotruss_ros.core import (
    Configuration,
    ConvexObject,
    Grip,
    HoldStatus,
    RollingGrip,
    solve_twist,
)
from isotruss_ros.core.errors import ConfigurationError, StructureError
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.grip_response import slip_planes
from isotruss_ros.core.holding.held_grip import HeldGrip, NotHeldError
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.mujoco_plant.plant import MujocoPlant
import numpy as np
from pressed_plants import place, press, PressedCase, release
from scipy.interpolate import CubicSpline
from studies.comparison.section import Check, Section
from studies.paper.tables import number, Table
from wedge import MODULE

CASES, SEED = 50, 0
#: Ranges of opening angles [degrees], shifts into the corner [m], diameters [m] and friction [-].
WEDGES, SHIFTS, DIAMETERS, FRICTIONS = (25, 60), (0.02, 0.08), (0.16, 0.32), (0.4, 0.9)
#: Largest velocity of the object, with rotations times the radius [m/s], and duration of the
#: motion [s].
SPEED, DURATION = 0.02, 3.0
#: Excess of the slip margin over the load [-], and smallest slip margin [N].
ABOVE, LEAST = 0.1, 1.0
#: Rise time of the load [s], rate of its steps [Hz], and number of segments of the path [-].
RISE, RATE, WAYPOINTS = 1.0, 50, 15
#: Rest after the release [s].
REST = 1.5
#: Position error at which an object counts as dropped [m].
DROPPED = 0.03


@dataclass(frozen=True)
class Case:
    """A grasp with a load and a motion."""

    grip: PressedCase  #: wedge and object
    friction: float  #: coefficient of friction between tube and object
    direction: Array | None  #: (3,) unit wrench of the load; None for the weakest direction
    twist: Array  #: (3,) twist of the object [m/s, rad/s]


@dataclass(frozen=True)
class Outcome:
    """Result of a case."""

    margin: float  #: smallest slip margin on the path without the load, by the model [N]
    load: float  #: norm of the load, with moments over the radius [N]
    off: float  #: final distance from the pose by the model [m]
    dropped: bool  #: whether the object was dropped


def compare(cases: int = CASES) -> Section:
    """
    Simulate random cases.

    :param cases: number of cases.
    """
    random, rows, dropped = np.random.default_rng(SEED), [], 0
    outcomes: list[Outcome] = []
    drawn = 0
    while len(outcomes) < cases:
        case, drawn = draw(random, weakest=drawn % 2 == 0), drawn + 1
        outcome = attempt(case)
        if outcome is None:
            continue
        outcomes.append(outcome)
        dropped += outcome.dropped
        twist = case.twist
        rows.append(
            (
                str(len(outcomes)),
                number(case.grip.degrees, 2),
                number(1e3 * case.grip.diameter),
                number(case.friction, 2),
                'weakest' if case.direction is None else 'random',
                number(outcome.load, 2),
                number(outcome.margin, 2),
                number(1e3 * float(np.hypot(*twist[:2])), 2),
                number(float(np.degrees(twist[2])), 2),
                number(1e3 * outcome.off, 2),
                'dropped' if outcome.dropped else 'held',
            )
        )
    check = Check(
        f'objects dropped in {cases} random cases, margin {100.0 * ABOVE:.0f} % above the load',
        float(dropped),
        0.0,
        '',
        '',
    )
    return Section(
        'Nothing is dropped whose slip margin exceeds the load',
        'Corner angle, shift into the corner, object, friction, load and motion are chosen at '
        'random. The load is the smallest slip margin of our model on the path, divided by '
        f'{1.0 + ABOVE:g}, in every second case in the direction of the smallest margin. It rises '
        f'in {RISE:g} s; then the rollers carry the object in open loop for {DURATION:g} s. '
        f'Grasps with a margin below {LEAST:g} N, or with tubes that would wrinkle, are replaced.',
        (check,),
        (
            Table(
                'drops',
                'All cases; “off” is the final distance of the object from its position in our '
                'model',
                (
                    'case',
                    'wedge [°]',
                    'diameter [mm]',
                    'friction',
                    'load along',
                    'load [N]',
                    'slip margin [N]',
                    'speed [mm/s]',
                    'turn [°/s]',
                    'off [mm]',
                    'object',
                ),
                rows,
                shown=False,
            ),
        ),
    )


def draw(random: np.random.Generator, weakest: bool) -> Case:
    """
    Return a random case.

    :param random: random number generator.
    :param weakest: whether the load is along the weakest direction of the grasp.
    """
    grip = PressedCase(*(float(random.uniform(*range_)) for range_ in (WEDGES, SHIFTS, DIAMETERS)))
    friction = float(random.uniform(*FRICTIONS))
    direction, twist = random.standard_normal(3), random.uniform(-SPEED, SPEED, 3)
    twist[2] /= 0.5 * grip.diameter
    along = None if weakest else direction / np.linalg.norm(direction)
    return Case(grip, friction, along, twist)


def attempt(case: Case) -> Outcome | None:
    """
    Simulate a case in MuJoCo; return None if the model does not hold the object initially.

    :param case: the case.
    """
    if not _is_worth(case):
        return None
    plant, config, cylinder = press(case.grip)
    release(plant, case.friction, REST)
    body = cylinder.moved_to(plant.object_pose())
    try:
        model = attach_grip(config, body)
    except NotHeldError:
        return None
    travels = _travels(config, case, body)
    if travels is None:
        return None
    response = model.response
    margin = _least_margin(model, travels, case.friction)
    if response is None or margin < LEAST:
        return None
    along = case.direction
    if along is None:
        along = slip_planes(model.response, case.friction).direction
    load = margin / (1.0 + ABOVE)
    wrench = load * along * (1.0, 1.0, cylinder.arm)
    expected = _follow(model, travels, wrench)
    if expected is None:
        return Outcome(margin, load, float('inf'), True)
    _drive(plant, travels, wrench)
    off = np.array(plant.object_pose()[:2]) - expected.pose[:2]
    apart = float(np.hypot(*off))
    return Outcome(margin, load, apart, apart > DROPPED or len(plant.contact_forces()) < 2)


def _is_worth(case: Case) -> bool:
    """Return whether a grasp may resist a load, as a quick filter before the simulation."""
    try:
        config, cylinder = place(case.grip)
        model = attach_grip(config, cylinder)
    except (ConfigurationError, NotHeldError, StructureError):
        return False
    if model.hold(case.friction) is not HoldStatus.HELD:
        return False
    wrinkles = float(model.sections.used.max()) > 1.0
    return model.slip_margin(case.friction) > LEAST and not wrinkles


def _travels(config: Configuration, case: Case, body: ConvexObject) -> list[Array] | None:
    """Return roller travels along the motion at uniform times; None if it is not reachable."""
    held = RollingGrip.attach(config, Grip.at_module(config.robot, MODULE, body))
    travels, lengths = [], 1.0 - np.cos(2.0 * np.pi * (np.arange(WAYPOINTS) + 0.5) / WAYPOINTS)
    for length in lengths * DURATION / WAYPOINTS:
        command = solve_twist(held.config, held.grip, case.twist)
        if command.scale < 1.0:
            return None
        travels.append(held.config.roller_positions + length * command.roller_velocities)
        held = held.moved_to(held.config.moved_to(travels[-1]))
    return travels


def _least_margin(model: HeldGrip, travels: Sequence[Array], friction: float) -> float:
    """Return the smallest slip margin without a load [N]; zero if the object is not held."""
    least, there = model.slip_margin(friction), model
    for travel in travels:
        moved = roll_grip(there, there.config.moved_to(travel))
        if moved is None or moved.hold(friction) is not HoldStatus.HELD:
            return 0.0
        there, least = moved, min(least, moved.slip_margin(friction))
    return least


def _follow(model: HeldGrip, travels: Sequence[Array], wrench: Array) -> HeldGrip | None:
    """Return the grasp by the model at the end of the motion, under the load."""
    there = roll_grip(model, model.config, wrench)
    for travel in travels:
        if there is None:
            return None
        there = roll_grip(there, there.config.moved_to(travel), wrench)
    return there


def _drive(plant: MujocoPlant, travels: Sequence[Array], wrench: Array) -> None:
    """Apply the load, carry the object, and stop."""
    steps = round(RISE * RATE)
    for k in range(steps):
        plant.pull((k + 1) / steps * wrench)
        plant.settle(1.0 / RATE)
    places = np.vstack([plant.travel, *travels])
    way = CubicSpline(np.linspace(0.0, DURATION, len(places)), places, bc_type='clamped')
    for time in np.arange(1, round(DURATION * RATE) + 1) / RATE:
        plant.advance(1.0 / RATE, RATE * (way(time) - plant.travel))
    plant.settle(REST)
