# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random walks of a held object under the twist servo, with the smallest margins of each walk."""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass

from isotruss_ros.core import (
    ConvexObject,
    Grip,
    IsotrussError,
    load_robot,
    RollingGrip,
    Status,
    tangent_center,
    TwistServo,
)
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.inputs import RollerState, StampedInput
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.safety.margins import object_distances, shape_margins
from isotruss_ros.core.safety.shape_guard import ShapeBounds
from isotruss_ros.core.servo.servo_settings import ServoSettings
import numpy as np

ROBOT = load_robot('nine_member')
BOUNDS = ShapeBounds()
LEAST = (BOUNDS.min_rigidity, BOUNDS.min_clearance, BOUNDS.min_object_clearance)
#: Grips that can move the object in every direction.
GRIPS = ('north/Z', 'north/R', 'north/P', 'east/Q', 'east/R')
PERIODS = (0.05, 0.01, 0.005, 0.002, 0.001)
#: Largest age of an input [s].
LATE = 0.15


@dataclass
class Walk:
    """
    Result of a walk.

    `lowest` has the smallest margins of rigidity [-], clearance [m] and clearance of the object
    [m], at and between the samples; a margin is negative if the walk crossed a bound. `quickest`
    is the largest acceleration of a roller [m/s^2].
    """

    lowest: np.ndarray
    statuses: Counter[Status]
    quickest: float = 0.0

    @property
    def crossed(self) -> bool:
        """Return whether a margin became negative."""
        return bool((self.lowest < 0.0).any())


def rolled(rolling: RollingGrip, travel: Array) -> RollingGrip:
    """Return a rolling grip after some roller travel (r,) [m]."""
    return rolling.moved_to(rolling.config.moved_to(rolling.config.roller_positions + travel))


def margins(held: RollingGrip) -> Array:
    """Return the margins of rigidity, clearance and object clearance to their bounds."""
    found = shape_margins(held.config)
    away = object_distances(held.config, held.grip.body, held.grip.members)
    return np.array([found.rigidity, found.clearance, away.min()]) - LEAST


def begin(rng: np.random.Generator, module: str) -> RollingGrip:
    """Return an object held at a module, in a random configuration within the bounds."""
    file = ROBOT.description
    while True:
        try:
            config = ROBOT.configuration(rng.uniform(-0.35, 0.35, len(ROBOT.roller_names)))
            diameter = float(rng.uniform(0.1, 0.4))
            body = ConvexObject.disc(tangent_center(config, module, diameter), diameter)
            held = RollingGrip.attach(config, Grip.at_module(ROBOT, module, body))
        except IsotrussError:
            continue
        lengths = config.member_lengths
        fits = lengths.min() > file.min_length and lengths.max() < file.max_length
        if fits and margins(held).min() > 0.002:
            return held


@dataclass
class Sensors:
    """
    Delays of the measured rollers and pose in cycles [-], and whether speeds are measured.

    Measured speeds are those of the cycle before the measurement.
    """

    rollers: int
    pose: int
    speeds: bool

    @classmethod
    def of(cls, seed: int, period: float) -> Sensors:
        """Return sensors with random delays by the seed: none, one cycle, or up to 150 ms."""
        rng = np.random.default_rng([seed, 1])
        speeds = bool(rng.integers(2))
        kind = seed // 2 % 4
        if kind < 2:
            return cls(kind, kind, speeds)
        rollers, pose = (round(late / period) for late in rng.uniform(0.0, LATE, 2))
        if kind == 2:
            rollers = pose = round(LATE / period)
        return cls(rollers, pose, speeds)


def walk(
    seed: int,
    steps: int,
    slide: bool = False,
    guarded: bool = True,
    sensors: Sensors | None = None,
) -> Walk:
    """
    Command random twists, larger than the robot can execute, at 20 Hz to 1 kHz.

    Measurements are exact, but delayed; see `Sensors`.
    """
    rng = np.random.default_rng(seed)
    module = GRIPS[seed % len(GRIPS)]
    held = begin(rng, module)
    period = float(rng.choice(PERIODS, p=[0.15, 0.35, 0.3, 0.1, 0.1]))
    sensors = Sensors.of(seed, period) if sensors is None else sensors
    settings = ServoSettings(
        held.grip,
        period,
        timeout=0.2,
        bounds=ShapeBounds() if guarded else None,
        slide_along_limits=slide,
    )
    servo = TwistServo(ROBOT, settings)
    result = Walk(np.full(3, np.inf), Counter())
    length = 1 + max(sensors.rollers, sensors.pose)
    seen = deque([(held, np.zeros(len(ROBOT.roller_names)))] * length, length)
    left, twist = 0, np.zeros(3)
    for step in range(steps):
        if left == 0:
            left, twist = int(rng.integers(20, 800)), rng.standard_normal(3) * 0.2
        left -= 1
        now = 1.0 + step * period
        (state, speeds), (place, _) = seen[-1 - sensors.rollers], seen[-1 - sensors.pose]
        measured = RollerState(
            state.config.roller_positions, speeds if sensors.speeds else 0.0 * speeds
        )
        servo.receive(
            twist=StampedInput(twist, now),
            rollers=StampedInput(measured, now - period * sensors.rollers),
            pose=StampedInput(place.pose, now - period * sensors.pose),
        )
        decision = servo.decide(now)
        command = decision.command
        if command.status >= Status.HALT_NO_TWIST:
            assert not guarded, decision.message
            return result  # at a singular shape
        result.statuses[command.status] += 1
        velocities = command.roller_velocities
        try:
            end = rolled(held, period * velocities)
        except ConfigurationError:
            assert not guarded
            return result
        lowest = margins(end)
        if lowest.min() < 0.01:
            half = rolled(held, 0.5 * period * velocities)
            lowest = np.minimum(lowest, margins(half))
        change = np.abs(velocities - seen[-1][1]).max()
        result.quickest = max(result.quickest, float(change) / period)
        held = end
        seen.append((held, velocities))
        result.lowest = np.minimum(result.lowest, lowest)
    return result
