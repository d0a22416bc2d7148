# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Reach and path following of the nine-member robot with one failed roller.

Reach is the area that the object's centre can reach from home. It is computed by a flood fill of a
grid: the twist program moves the object from a cell to its neighbours, and slides along the limits
of the robot file and the bounds of the configuration. The opening angle of the grip is constant,
and the object is not rotated unless necessary.

Path following is one lap of a circle by feed-forward, with the servo and a simulated robot whose
roller is stuck. The failure is either unknown to the servo or detected by it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterator
import math

from isotruss_ros.core import (
    ConvexObject,
    Grip,
    load_robot,
    RigidObject,
    RollerFaults,
    RollingGrip,
    ShapeGuard,
    SimulatedRobot,
    solve_twist,
    tangent_center,
    TwistServo,
)
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.inputs import RollerState, StampedInput
from isotruss_ros.core.manipulation.limit_handling import LimitHandling
from isotruss_ros.core.manipulation.solve_twist import default_limits
from isotruss_ros.core.safety.roller_failure import FAILURE_TIME
from isotruss_ros.core.safety.shape_guard import ShapeBounds
from isotruss_ros.core.servo.servo_settings import ServoSettings
import numpy as np
from studies.benchmarks.measuring import part, SHARE, Table

MODULE, DIAMETER = 'north/Z', 0.3
#: Spacing of the grid, and tolerance of the centre of a cell [m].
SPACING, ARRIVED = 0.1 if SHARE == 1.0 else 1.0, 0.005
#: Period of a step [s], and number of steps without progress that end the motion [-].
STEP, PATIENCE, GAIN = 0.1, 5, 2e-4
RADIUS, LAP, PERIOD = 0.1, max(0.1, 60.0 * SHARE), 0.02

ROBOT = load_robot('nine_member')
HELD = RollingGrip.attach(
    ROBOT.home,
    Grip.at_module(
        ROBOT, MODULE, ConvexObject.disc(tangent_center(ROBOT.home, MODULE, DIAMETER), DIAMETER)
    ),
)
LIMITS = default_limits(ROBOT)
STILL = np.zeros(len(ROBOT.roller_names))


def carry(
    held: RollingGrip, goal: complex, guard: ShapeGuard, failed: Collection[str]
) -> RollingGrip | None:
    """Move the object to a goal; return its grip at the goal, or None if it is not reached."""
    nearest, idle = abs(goal - held.grip.center), 0
    while idle < PATIENCE:
        config, missing = held.config, goal - held.grip.center
        if abs(missing) < ARRIVED:
            return held
        velocity = missing * min(ROBOT.description.max_speed / abs(missing), 1.0 / STEP)
        twist = (velocity.real, velocity.imag, 0.0)
        watch = guard.watch(config, held.grip)
        limits = (*LIMITS, *watch.limits)
        command = solve_twist(
            config,
            held.grip,
            twist,
            failed,
            limits,
            handling=LimitHandling(True, regularized=True),
        )
        command = watch.keep(command, STILL, STEP)
        try:
            travel = config.roller_positions + STEP * command.roller_velocities
            held = held.moved_to(config.moved_to(travel))
        except ConfigurationError:
            return None
        left = abs(goal - held.grip.center)
        idle = idle + 1 if left > nearest - GAIN else 0
        nearest = min(nearest, left)
    return None


def reached(failed: Collection[str]) -> set[tuple[int, int]]:
    """Return the cells that the object reaches from home."""
    guard, start = ShapeGuard(ROBOT, ShapeBounds()), HELD.grip.center
    found = {(0, 0): HELD}
    waiting = deque(found)
    while waiting:
        here = waiting.popleft()
        for dx, dy in ((1, 0), (0, 1), (-1, 0), (0, -1)):
            cell = here[0] + dx, here[1] + dy
            if cell not in found:
                there = carry(found[here], start + SPACING * complex(*cell), guard, failed)
                if there is not None:
                    found[cell] = there
                    waiting.append(cell)
    return set(found)


def follow(stuck: str | None, detect: bool) -> float:
    """Follow one lap; return the largest position error of the object [m]."""
    time = FAILURE_TIME if detect else math.inf
    servo = TwistServo(ROBOT, ServoSettings(HELD.grip, PERIOD, timeout=1.0, failure_time=time))
    faults = RollerFaults(stuck=frozenset() if stuck is None else frozenset([stuck]))
    robot = SimulatedRobot(ROBOT.home, RigidObject(HELD), faults)
    start, error = HELD.grip.center, 0.0
    for k in range(round(LAP / PERIOD)):
        now = k * PERIOD
        turn = np.exp(2j * np.pi * (now + 0.5 * PERIOD) / LAP)
        velocity = 2.0 * np.pi / LAP * RADIUS * 1j * turn
        servo.receive(twist=StampedInput((velocity.real, velocity.imag, 0.0), now))
        state = RollerState(robot.config.roller_positions, robot.roller_velocities)
        servo.receive(rollers=StampedInput(state, now), pose=StampedInput(robot.object_pose, now))
        robot.command(servo.decide(now).command.roller_velocities)
        robot.advance(PERIOD)
        goal = start + RADIUS * (np.exp(2j * np.pi * (now + PERIOD) / LAP) - 1.0)
        error = max(error, abs(complex(*robot.object_pose[:2]) - goal))
    return error


def tables() -> Iterator[Table]:
    """Yield the tables of the case."""
    whole = reached([])
    rows = [['none', f'{SPACING**2 * len(whole):.2f}', '', f'{1e3 * follow(None, False):.4f}', '']]
    for name in ROBOT.roller_names[: part(len(ROBOT.roller_names))]:
        cells = reached([name])
        errors = [f'{1e3 * follow(name, detect):.4f}' for detect in (False, True)]
        kept = f'{100 * len(cells & whole) / len(whole):.0f} %'
        rows.append([name, f'{SPACING**2 * len(cells):.2f}', kept, *errors])
    header = ('failed', 'reached [m^2]', 'kept', 'unknown [mm]', 'detected [mm]')
    yield Table('', header, rows)
