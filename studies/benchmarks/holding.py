# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Errors of pose and squeeze of a held object on the elastic plant, without and with loads.

Random objects in random grips of the nine-member robot follow random paths. The controllers are
the paper's program for a rigid robot in open loop, and the model of the held object in the loop,
without and with loads that the controller does not know. Paths with binding limits or slip are
replaced by other random ones. The tubes of the plant do not wrinkle, so the utilisation is not
bounded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
import math
from typing import TypeAlias

from isotruss_ros.core import (
    Configuration,
    ConvexObject,
    ElasticObject,
    Grip,
    HoldStatus,
    IsotrussError,
    load_robot,
    RollerFaults,
    SimulatedRobot,
    solve_twist,
    Status,
    tangent_center,
)
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.inputs import StampedInput
from isotruss_ros.core.manipulation.status import RollerCommand
from isotruss_ros.core.servo.servo_settings import SqueezeSettings
from isotruss_ros.core.servo.squeeze_control import SqueezeControl
import numpy as np
from studies.benchmarks.measuring import part, SHARE, Table, timed
from wedge import closed_to

ROBOT = load_robot('nine_member')
MODULES = ('north/Z', 'south/P', 'east/Q', 'east/R', 'north/R')
FRICTION, PERIOD, DURATION = 0.5, 0.02, max(0.2, 2.0 * SHARE)
#: Smallest slip margin at the start of a path [N].
MIN_MARGIN = 1.5
#: Loads unknown to the controller [N].
LOAD, ROTATING = 5.0, 3.0
#: Load (fx, fy, m) [N, N m] at a time [s].
Load: TypeAlias = Callable[[float], tuple[float, float, float]]
OPEN, MODEL = 'rigid, open loop', 'model in the loop'


@dataclass(frozen=True)
class Path:
    """A grip, and the peak twist of a motion from rest to rest."""

    config: Configuration
    body: ConvexObject
    module: str
    twist: np.ndarray


@dataclass(frozen=True)
class Run:
    """Errors of all cycles of a path, pause at oscillations, and time of a command [s]."""

    distance: np.ndarray
    squeeze: np.ndarray
    pause: float
    time: float


def random_path(rng: np.random.Generator) -> Path | None:
    """Return a path whose grip closes a random wedge at a module on an object."""
    module, diameter = str(rng.choice(MODULES)), rng.uniform(0.16, 0.22)
    try:
        config = closed_to(ROBOT.home, rng.uniform(28.0, 34.0), diameter, module)
        center = tangent_center(config, module, diameter, rng.uniform(0.05, 0.12))
    except IsotrussError:
        return None
    speed, heading = rng.uniform(0.04, 0.08), rng.uniform(0.0, 2.0 * np.pi)
    twist = np.array([speed * np.cos(heading), speed * np.sin(heading), rng.uniform(-0.4, 0.4)])
    return Path(config, ConvexObject.disc(center, diameter), module, twist)


def follow(
    path: Path,
    mode: str,
    load: Load | None = None,
    least: float = MIN_MARGIN,
) -> Run | str:
    """Follow a path on the plant; return its errors, or the reason of its rejection."""
    plant_object = ElasticObject(path.body, FRICTION)
    plant = SimulatedRobot(path.config, plant_object, RollerFaults())
    plant.advance(0.0)
    if plant_object.grasp is None:
        return 'not held'
    model = attach_grip(path.config, path.body)
    if plant_object.slip_margin < least:
        return 'margin'
    force = model.squeeze
    settings, control = SqueezeSettings(force, max_utilisation=math.inf), SqueezeControl()
    reference, count = np.array(plant.object_pose), round(DURATION / PERIOD)
    errors, squeezes, times, paused = [], [], [], 0
    for k in range(count + count // 2):  # the last third at rest: what a load did is made up for
        rate = 1.0 - math.cos(2.0 * math.pi * (k + 0.5) / count) if k < count else 0.0
        if load is not None:
            plant_object.external_wrench = load(k * PERIOD)
        wanted = rate * path.twist
        sample = StampedInput(plant.object_pose, k * PERIOD), 0.0
        cycle = partial(decide, path, plant, settings, control, mode, wanted, sample)
        duration, found = timed(cycle)
        if isinstance(found, str):
            return found
        control, command, correction = found
        control = control.advanced(wanted, command, correction)
        times.append(duration)
        plant.command(command.roller_velocities)
        plant.advance(PERIOD)
        if plant_object.grasp is None:
            return f'dropped: {plant_object.dropped.value}'
        reference = reference + PERIOD * rate * command.scale * path.twist
        paused += command.scale == 0.0
        errors.append(pose_error(reference, plant))
        squeezes.append(plant_object.grasp.squeeze / force - 1.0)
    found = np.hypot(*np.array(errors)[:, :2].T)
    return Run(found, np.abs(np.array(squeezes)), PERIOD * paused, float(np.median(times)))


def decide(
    path: Path,
    plant: SimulatedRobot,
    settings: SqueezeSettings,
    control: SqueezeControl,
    mode: str,
    wanted: np.ndarray,
    sample: tuple[StampedInput, float],
) -> tuple[SqueezeControl, RollerCommand, np.ndarray] | str:
    """Return control, command and correction of one cycle, or why there is no command."""
    config, pose = plant.config, plant.object_pose
    grip = Grip.at_module(ROBOT, path.module, path.body.moved_to(pose), FRICTION)

    def solve(twist: np.ndarray, opening_rate: float) -> RollerCommand:
        return solve_twist(config, grip, twist, opening_rate=opening_rate)

    correction = np.zeros(3)
    if mode != MODEL:
        command = solve(wanted, 0.0)
    else:
        control, hold = control.followed(settings, config, grip, PERIOD, sample)
        if hold is not HoldStatus.HELD:
            return 'not held'
        control, command, correction = control.command(settings, wanted, PERIOD, solve)
    if command.status is Status.UNREACHABLE:
        return 'unreachable'
    paused = command.status is Status.HALT_OSCILLATES
    if not paused and command.scale < 1.0:
        return 'limit'
    return control, command, correction


def pose_error(reference: np.ndarray, plant: SimulatedRobot) -> np.ndarray:
    """Return the pose error relative to the reference: x, y [m], angle [rad]."""
    error = reference - np.array(plant.object_pose)
    error[2] = math.remainder(error[2], 2.0 * math.pi)
    return error


def feasible_paths(number: int, least: float = MIN_MARGIN) -> Iterator[Path]:
    """Draw a number of paths that can be followed without a load, with a slip margin."""
    rng, found = np.random.default_rng(1), 0
    while found < number:
        path = random_path(rng)
        outcome = 'no room' if path is None else follow(path, MODEL, least=least)
        if isinstance(outcome, Run):
            found += 1
            yield path


def constant(_time: float) -> tuple[float, float, float]:
    """Return a constant load (fx, fy, m) [N, N m]."""
    return 0.6 * LOAD, 0.8 * LOAD, 0.0


def rotating(time: float) -> tuple[float, float, float]:
    """Return a load that rotates at 3 rad/s and rises in 0.5 s (fx, fy, m) [N, N m]."""
    size = ROTATING * min(1.0, 2.0 * time)
    return size * math.cos(3.0 * time), size * math.sin(3.0 * time), 0.0


def tables() -> Iterator[Table]:
    """Yield the tables of the case."""
    number = part(20)
    paths, strong = list(feasible_paths(number)), list(feasible_paths(number, LOAD))
    rows = []
    for name, mode, load, driven in (
        (OPEN, OPEN, None, paths),
        (MODEL, MODEL, None, paths),
        ('constant 5 N', MODEL, constant, strong),
        ('rotating 3 N', MODEL, rotating, strong),
    ):
        runs = [follow(path, mode, load) for path in driven]
        done = [run for run in runs if isinstance(run, Run)]
        worst = np.array([(1e3 * r.distance.max(), 1e2 * r.squeeze.max()) for r in done])
        if not done:
            rows.append((name, f'0 / {len(runs)}', *5 * ['-']))
            continue
        middle, most = np.median(worst, axis=0), worst.max(axis=0)
        rows.append(
            (
                name,
                f'{len(done)} / {len(runs)}',
                f'{middle[0]:.3f} / {most[0]:.3f}',
                f'{1e3 * max(run.distance[-1] for run in done):.3f}',
                f'{middle[1]:.2f} / {most[1]:.2f}',
                f'{np.mean([run.pause for run in done]):.2f}',
                f'{1e3 * np.median([run.time for run in done]):.2f}',
            )
        )
    errors = 'pose [mm]', 'at the end [mm]', 'squeeze [%]'
    header = ('controller', 'held', *errors, 'mean pause [s]', 'command [ms]')
    yield Table('Median / worst of the largest error of each path.', header, rows)
