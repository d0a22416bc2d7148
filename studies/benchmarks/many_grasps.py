# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Processor time of a grasp among many.

Grasps are those of the nine-member preset at home, with an object at random poses: of one object
at the top module between two members, or of a large disc inside a triangle of three members. Calls
of `settle_grasp` and of `settle_grasps` alternate. The tables of the dents are the same in all
grasps, and are computed before.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

from isotruss_ros import core
import numpy as np
from studies.benchmarks.measuring import part, SHARE, Table, timed

ROBOT = core.load_robot('nine_member')
MEMBERS = ('north/P-Z', 'north/Z-R')
#: Numbers of grasps at once, and number of repetitions.
COUNTS = (1, 16, 128) if SHARE >= 1.0 else (1, 4)
REPETITIONS = part(3)
FRICTION, WRENCH = 0.8, (1.0, -0.5, 0.02)


def box(width: float, height: float) -> core.Polygon:
    """Return a rectangle about its origin."""
    x, y = 0.5 * width, 0.5 * height
    return core.Polygon([(-x, -y), (x, -y), (x, y), (-x, y)])


def hexagon(size: float) -> core.Polygon:
    """Return a regular hexagon about its origin."""
    corners = size * np.exp(1j * np.pi / 3.0 * np.arange(6))
    return core.Polygon([(z.real, z.imag) for z in corners.tolist()])


def objects() -> dict[str, core.ConvexObject]:
    """Return the objects at their nominal poses by their names."""
    shapes = {'disc': core.Disc(0.3), 'box': box(0.25, 0.25), 'hexagon': hexagon(0.15)}
    between_two = {
        name: core.place_between(ROBOT.home, MEMBERS, shape, 0.0, 0.01).body
        for name, shape in shapes.items()
    }
    loop = ('south/P-Q', 'south/Q-X', 'south/X-P')
    enclosed = core.place_between(ROBOT.home, loop, core.Disc(0.65), 0.0, 0.01).body
    return between_two | {'disc, three members': enclosed}


def tables() -> Iterator[Table]:
    """Yield the table of the case."""
    columns = [f'of {count} [ms]' for count in COUNTS]
    header = ('object', 'settle_grasp [ms]', *columns, 'ratio')
    yield Table('', header, [row for item in objects().items() for row in rows(*item)])


def rows(name: str, body: core.ConvexObject) -> Iterator[list[str]]:
    """Yield the rows of one object without and with an external wrench."""
    random = np.random.default_rng(1)
    changes = random.uniform(-1.0, 1.0, (max(COUNTS), 3)) * (0.003, 0.004, 0.05)
    poses = np.array(body.pose) + changes
    for words, wrench in ((name, np.zeros(3)), (f'{name}, with a load', np.array(WRENCH))):
        one = [partial(settle, body.moved_to(pose), wrench) for pose in poses[:20]]
        many = [partial(settle_many, body, poses[:count], wrench) for count in COUNTS]
        times = alternate([*one, *many])
        single, of_many = np.median(times[: len(one)]), times[len(one) :] / COUNTS
        cells = [f'{1e3 * time:.2f}' for time in (single, *of_many)]
        yield [words, *cells, f'{single / of_many[-1]:.1f}']


def settle(body: core.ConvexObject, wrench: np.ndarray) -> object:
    """Settle one grasp in a new configuration."""
    return core.settle_grasp(unprepared(), body, FRICTION, wrench)


def settle_many(body: core.ConvexObject, poses: np.ndarray, wrench: np.ndarray) -> object:
    """Settle grasps in a new configuration."""
    return core.settle_grasps(unprepared(), body, FRICTION, wrench, poses=poses)


def unprepared() -> core.Configuration:
    """Return the home configuration without cached results."""
    return core.Configuration(ROBOT, ROBOT.home.roller_positions, ROBOT.home.points)


def alternate(calls: list[Callable[[], object]]) -> np.ndarray:
    """Return the median times of calls that alternate, after a first round [s]."""
    times = [[timed(call)[0] for call in calls] for _ in range(1 + REPETITIONS)]
    return np.median(times[1:], axis=0)
