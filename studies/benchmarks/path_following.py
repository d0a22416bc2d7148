# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Errors of path following with and without feedback of the measured pose.

The path is that of the paper's Fig. 9: up, a rotation in place, and an arc to which the
orientation stays normal. The rollers of the simulated robot slip, roller speeds and the measured
pose are noisy, and the pose is one cycle old. The node `manipulation` would send the same
commands. Open loop is the same feed-forward without feedback. Errors are errors of the true pose.
"""

from __future__ import annotations

from collections.abc import Iterator
import math
from typing import NamedTuple

from isotruss_ros.core import (
    ConvexObject,
    Grip,
    load_robot,
    ObjectPath,
    PathTracker,
    Pose,
    RigidObject,
    RollerFaults,
    RollingGrip,
    SimulatedRobot,
    tangent_center,
    TwistServo,
)
from isotruss_ros.core.inputs import RollerState, StampedInput
from isotruss_ros.core.paths.path_tracking import FINISHED, PathPhase, TrackingSettings
from isotruss_ros.core.servo.servo_settings import ServoSettings
import numpy as np
from studies.benchmarks.measuring import part, SHARE, Table

ROBOT = load_robot('nine_member')
MODULE, DIAMETER = 'north/Z', 0.3
GRIP = Grip.at_module(
    ROBOT, MODULE, ConvexObject.disc(tangent_center(ROBOT.home, MODULE, DIAMETER), DIAMETER)
)
SPEED, TURN_RATE = 0.03, 0.25
#: Period of the robot and of the node `manipulation` [s]; the tracker runs in each second cycle.
PERIOD = 0.005 if SHARE == 1.0 else 0.1
#: Standard deviations: speed of a moving roller [m/s], measured position [m] and angle [rad].
NOISE = (0.005, 0.001, 0.01)
SEEDS = part(3)
#: Tolerances so wide that they neither stop nor slow the object, to compare the errors.
WIDE = {'position_tolerance': 1.0, 'angle_tolerance': 3.0}
LOOPS = {
    'open': TrackingSettings(**WIDE, position_gain=0.0, angle_gain=0.0),
    'closed': TrackingSettings(**WIDE),
}


class Errors(NamedTuple):
    """Errors of the true pose in every cycle: position [m] and angle [rad]."""

    position: np.ndarray
    angle: np.ndarray


def figure_9() -> ObjectPath:
    """Return the path with poses every 2 degrees along the arc."""
    x, y = GRIP.body.pose[:2]
    turned = np.radians(np.arange(0.0, 91.0, 2.0))
    arc = np.column_stack(
        [
            x + 0.25 * np.sin(turned),
            y + 0.2 - 0.25 * (1.0 - np.cos(turned)),
            0.5 * math.pi - turned,
        ]
    )
    return ObjectPath([(x, y, 0.0), (x, y + 0.2, 0.0), *arc], SPEED, TURN_RATE)


def follow(path: ObjectPath, loop: str, slip: float, noisy: bool, seed: int) -> Errors:
    """Follow the path once, and return its errors."""
    roller_noise, position_noise, angle_noise = NOISE if noisy else (0.0, 0.0, 0.0)
    rng = np.random.default_rng([seed, 2])
    held = RigidObject(RollingGrip.attach(ROBOT.home, GRIP))
    faults = RollerFaults(noise=roller_noise, slip=slip)
    robot = SimulatedRobot(ROBOT.home, held, faults, seed)
    servo = TwistServo(ROBOT, ServoSettings(GRIP, PERIOD, timeout=0.1))
    tracker = PathTracker(path, LOOPS[loop], 2.0 * PERIOD)
    position, angle = [], []
    cycle, tracking, scale = 0, None, 1.0
    while True:
        now = cycle * PERIOD
        error = path.pose(tracker.clock.time_then(PERIOD, 0.0)) - np.array(robot.object_pose)
        if cycle % 2 == 0:
            position.append(math.hypot(*error[:2]))
            angle.append(abs(math.remainder(error[2], 2.0 * math.pi)))
            measured = np.array(robot.object_pose) + rng.normal(size=3) * (
                position_noise,
                position_noise,
                angle_noise,
            )
            state = RollerState(robot.roller_positions, robot.roller_velocities)
        else:
            # The tracker hears of the pose a cycle late.
            tracking = tracker.update(Pose(*measured), PERIOD, 2.0 * PERIOD, scale)
            if tracking.phase in FINISHED:
                break
        if tracking is not None:
            servo.receive(
                twist=StampedInput(tracking.twist, now),
                rollers=StampedInput(state, now - PERIOD * (cycle % 2)),
                pose=StampedInput(measured, now - PERIOD * (cycle % 2)),
            )
            command = servo.decide(now).command
            scale = command.scale
            robot.command(command.roller_velocities)
        robot.advance(PERIOD)
        cycle += 1
    assert tracking.phase is PathPhase.REACHED, tracking.message
    return Errors(np.array(position), np.array(angle))


def several(path: ObjectPath, loop: str, slip: float, noisy: bool) -> list[str]:
    """Return root mean square and largest errors of the path over several seeds."""
    runs = [follow(path, loop, slip, noisy, seed) for seed in range(SEEDS)]
    position, angle = (np.concatenate(each) for each in zip(*runs, strict=True))
    rms = float(np.sqrt(np.mean(position**2)))
    return [f'{1e3 * value:.2f}' for value in (rms, position.max(), angle.max())]


def tables() -> Iterator[Table]:
    """Yield the tables of the case."""
    path = figure_9()
    rows = []
    for name, slip, noisy in (
        ('neither', 0.0, False),
        ('noise', 0.0, True),
        ('5 % slip', 0.05, False),
        ('5 % slip and noise', 0.05, True),
    ):
        rows.append([name, *(text for loop in LOOPS for text in several(path, loop, slip, noisy))])
    columns = [
        f'{loop}: {what}' for loop in LOOPS for what in ('rms [mm]', 'max [mm]', 'angle [mrad]')
    ]
    yield Table('', ('disturbance', *columns), rows)
