# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How well a held object keeps its pose and its squeeze on the elastic plant, and what a load does.

Random grips of random objects on the nine-member robot, random paths; each path is run with the
paper's rigid program in open loop, with feedback of the pose, and with the model of the held
object in the loop. Then with loads that the controller does not know, and on a softer plant.
Paths on which a limit binds, or whose grip would slip, are drawn again and counted. The plant has
no wrinkles, so that the bound on the utilisation is left out.

    python benchmarks/holding.py [number of paths]
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
import math
import os
from pathlib import Path
import sys
from typing import TypeAlias

os.environ.update(OPENBLAS_NUM_THREADS='1', OMP_NUM_THREADS='1')  # before NumPy comes in
sys.path.append(str(Path(__file__).parents[1]))

from comparison.wedge import closed_to
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
from isotruss_ros.core.holding.attach_grip import attach_grip, rest
from isotruss_ros.core.manipulation.status import RollerCommand
from isotruss_ros.core.servo.squeeze_control import SqueezeControl, SqueezeSettings
from measuring import part, print_machine, print_table, SHARE, timed
import numpy as np
from scipy.optimize import root

ROBOT = load_robot('nine_member')
MODULES = ('north/Z', 'south/P', 'east/Q', 'east/R', 'north/R')
FRICTION, PERIOD, DURATION, GAIN = 0.5, 0.02, max(0.2, 2.0 * SHARE), 2.0
#: No path begins with less slip margin than this [N].
MIN_MARGIN = 1.5
#: Loads that the controller does not know [N].
LOAD, ROTATING = 5.0, 3.0
#: Load (fx, fy, m) [N, N m] at a time [s].
Load: TypeAlias = Callable[[float], tuple[float, float, float]]
OPEN, RIGID, MODEL = 'rigid, open loop', 'rigid + pose feedback', 'model in the loop + feedback'


@dataclass(frozen=True)
class Path:
    """A grip, and the twist at the middle of a motion that begins and ends at rest."""

    config: Configuration
    body: ConvexObject
    module: str
    twist: np.ndarray


@dataclass(frozen=True)
class Run:
    """What came of a path: errors in all cycles, time of a command, least margin by the model."""

    distance: np.ndarray
    angle: np.ndarray
    squeeze: np.ndarray
    time: float
    margin: float


def random_path(rng: np.random.Generator) -> Path | None:
    """Close a random wedge at a module and press an object into it."""
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
    scale: float = 1.0,
    least: float = MIN_MARGIN,
) -> Run | str:
    """Follow a path on the plant; return what came of it, or why it is none."""
    plant_object = ElasticObject(path.body, FRICTION, stiffness_scale=scale)
    plant = SimulatedRobot(path.config, plant_object, RollerFaults())
    plant.advance(0.0)
    if plant_object.grasp is None:
        return 'not held'
    model = attach_grip(path.config, path.body)
    if plant_object.slip_margin < least and scale == 1.0:
        return 'margin'
    force = model.squeeze
    control = SqueezeControl(SqueezeSettings(force, max_utilisation=math.inf))
    reference, count = np.array(plant.object_pose), round(DURATION / PERIOD)
    errors, squeezes, times, margins = [], [], [], []
    for k in range(count + count // 2):  # the last third at rest: what a load did is made up for
        rate = 1.0 - math.cos(2.0 * math.pi * (k + 0.5) / count) if k < count else 0.0
        if load is not None:
            plant_object.external_wrench = load(k * PERIOD)
        error = pose_error(reference, plant)
        wanted = rate * path.twist + (GAIN * error if mode == RIGID else 0.0)
        duration, command = timed(partial(decide, path, plant, control, mode, wanted))
        if isinstance(command, str):
            return command
        control.advance(wanted, command)
        margins.append(0.0 if control.belief is None else control.belief.slip_margin)
        times.append(duration)
        plant.command(command.roller_velocities)
        plant.advance(PERIOD)
        if plant_object.grasp is None:
            return f'dropped: {plant_object.dropped.value}'
        reference = reference + PERIOD * rate * path.twist
        errors.append(pose_error(reference, plant))
        squeezes.append(plant_object.grasp.squeeze / (scale * force) - 1.0)
    found = np.array(errors)
    return Run(
        np.hypot(found[:, 0], found[:, 1]),
        np.abs(found[:, 2]),
        np.abs(np.array(squeezes)),
        float(np.median(times)),
        min(margins),
    )


def decide(
    path: Path, plant: SimulatedRobot, control: SqueezeControl, mode: str, wanted: np.ndarray
) -> RollerCommand | str:
    """Return the command of one cycle, or why there is none."""
    config, pose = plant.config, plant.object_pose
    grip = Grip.at_module(ROBOT, path.module, path.body.moved_to(pose), FRICTION)

    def solve(twist: np.ndarray, opening_rate: float) -> RollerCommand:
        return solve_twist(config, grip, twist, opening_rate=opening_rate)

    if mode != MODEL:
        command = solve(wanted, 0.0)
    elif control.follow(config, grip, PERIOD) is HoldStatus.HELD:
        command = control.solve(wanted, PERIOD, solve)
    else:
        return 'not held'
    if command.status is Status.UNREACHABLE:
        return 'unreachable'
    return command if command.scale == 1.0 else 'limit'


def pose_error(reference: np.ndarray, plant: SimulatedRobot) -> np.ndarray:
    """Return what is missing to the reference: x, y [m], angle [rad]."""
    error = reference - np.array(plant.object_pose)
    error[2] = math.remainder(error[2], 2.0 * math.pi)
    return error


def feasible_paths(number: int, least: float = MIN_MARGIN) -> Iterator[Path]:
    """Draw paths, with a slip margin, until so many can be followed without a load."""
    rng, drawn, found = np.random.default_rng(1), 0, 0
    refused: dict[str, int] = {}
    while found < number:
        drawn += 1
        path = random_path(rng)
        outcome = 'no room' if path is None else follow(path, MODEL, least=least)
        if isinstance(outcome, Run):
            found += 1
            yield path
        else:
            refused[outcome] = refused.get(outcome, 0) + 1
    print(f'{drawn} paths drawn with a margin of {least:g} N; left out: {refused}')


def row(name: str, runs: list[Run | str]) -> list[str]:
    """Return median and worst errors of the paths that were followed to their end."""
    done = [run for run in runs if isinstance(run, Run)]
    if not done:
        return [name, f'0 / {len(runs)}', *[''] * 5]
    worst = np.array(
        [
            [
                1e3 * run.distance.max(),
                np.degrees(run.angle.max()),
                100.0 * run.squeeze.max(),
                1e3 * run.distance[-1],
            ]
            for run in done
        ]
    )
    middle, most = np.median(worst, axis=0), worst.max(axis=0)
    return [
        name,
        f'{len(done)} / {len(runs)}',
        f'{middle[0]:.3f} / {most[0]:.3f}',
        f'{most[3]:.3f}',
        f'{most[1]:.3f}',
        f'{middle[2]:.2f} / {most[2]:.2f}',
        f'{1e3 * np.median([run.time for run in done]):.2f}',
    ]


def constant(size: float) -> Load:
    """Return a load of a size [N] that is there from the beginning."""
    return lambda _time: (0.6 * size, 0.8 * size, 0.0)


def rotating(time: float) -> tuple[float, float, float]:
    """Return a load that turns at 3 rad/s, and comes within half a second (fx, fy, m) [N, N m]."""
    size = ROTATING * min(1.0, 2.0 * time)
    return size * math.cos(3.0 * time), size * math.sin(3.0 * time), 0.0


def print_foretold(paths: list[Path]) -> None:
    """Print how many paths larger and larger loads end, and how many of them with a margin."""
    for load in (LOAD, 2.0 * LOAD, 3.0 * LOAD):
        lost = [path for path in paths if isinstance(follow(path, MODEL, constant(load)), str)]
        models = [attach_grip(path.config, path.body) for path in lost]
        missed = sum(model.slip_margin(FRICTION) >= load for model in models)
        print(
            f'constant {load:g} N: {len(lost)} of {len(paths)} lost; '
            f'{missed} of these began with a slip margin of at least the load'
        )


def print_ratio(path: Path) -> None:
    """Print how long a command takes against SciPy's solver of the equilibrium alone."""
    grasp = attach_grip(path.config, path.body)
    closure = rest(grasp.statics, path.body)
    start = grasp.state.unknowns.copy()
    start[grasp.statics.places.normal] *= 0.9

    def equations(unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        residual, state = grasp.statics.equations(unknowns, grasp.wrench, closure)
        return residual, state.jacobian

    def solve() -> None:
        assert root(equations, start, jac=True).success

    solved = float(np.median([timed(solve)[0] for _ in range(100)]))
    command = follow(path, MODEL).time
    print(f'a command takes {command / solved:.2f} times scipy.optimize.root of one equilibrium')


def main() -> None:
    """Print the table."""
    print_machine()
    number = int(sys.argv[1]) if len(sys.argv) > 1 else part(20)
    paths = list(feasible_paths(number))
    rows = [row(mode, [follow(path, mode) for path in paths]) for mode in (OPEN, RIGID, MODEL)]

    rows.append(row('model, plant 30 % softer', [follow(p, MODEL, scale=0.7) for p in paths]))
    strong = list(feasible_paths(number, LOAD))
    rows.append(row('model, constant 5 N', [follow(p, MODEL, constant(LOAD)) for p in strong]))
    rows.append(row('model, rotating 3 N', [follow(p, MODEL, rotating) for p in strong]))
    header = [
        'controller',
        'held',
        'pose, median / worst [mm]',
        'at the end [mm]',
        'angle, worst [deg]',
        'squeeze off, median / worst [%]',
        'command [ms]',
    ]
    print_table(header, rows)
    print_ratio(paths[0])
    print_foretold(paths + strong)


if __name__ == '__main__':
    main()
