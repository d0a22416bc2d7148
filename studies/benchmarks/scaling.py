# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Computing times of kinematics for robots of 9 to 303 modules, on one core.

The robots are nested triangles, see large_robots.py.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
import tracemalloc

from isotruss_ros import core
from isotruss_ros.core.manipulation.limit_handling import LimitHandling
from isotruss_ros.core.manipulation.status import RollerCommand
from isotruss_ros.core.numerics.factorization import factorize
import numpy as np
from studies.benchmarks.kinematics import PaperProgram, State, unprepared
from studies.benchmarks.large_robots import nested_triangles, SIZES, top_module
from studies.benchmarks.measuring import median_time, Table, timed

DIAMETER = 0.15
#: Largest random roller travel from home [m]; small, because the travel of all modules adds up.
TRAVEL = 0.02
#: Duration of the repetitions of a call [s].
BUDGET = 0.2


@dataclass(frozen=True)
class Times:
    """Median computing times on one robot [s]."""

    forward: float  #: forward kinematics over one cycle at 200 Hz, full speed
    factor: float  #: matrix of (12) and its factorisation
    free: float  #: twist to rollers without binding limits
    limited: float  #: twist to rollers at twice the admissible twist, largest progress
    regularized: float  #: limited twist with the nodes' regularisation
    paper: float  #: free twist by the paper's (20), one dense linear system
    memory: int  #: peak memory of a limited twist [bytes]


def measure(robot: core.Robot, module: str) -> Times:
    """
    Return the times on one robot in a random state near home, without caches.

    :param module: module of the grip.
    """
    rng = np.random.default_rng(1)
    rollers = len(robot.roller_names)
    state = robot.configuration(rng.uniform(-TRAVEL, TRAVEL, rollers))
    step = robot.description.max_speed / 200.0 * rng.choice([-1.0, 1.0], rollers)
    body = core.ConvexObject.disc(core.tangent_center(state, module, DIAMETER), DIAMETER)
    grip = core.Grip.at_module(robot, module, body)
    twist = np.array([1.0, 0.5, 4.0])
    limit = core.solve_twist(state, grip, twist).scale * twist

    def solve(size: float, regularized: bool = False) -> RollerCommand:
        return core.solve_twist(
            unprepared(state), grip, size * limit, handling=LimitHandling(regularized=regularized)
        )

    solve(0.5)
    paper = PaperProgram(robot)
    given = State(state, grip, limit)
    tracemalloc.start()
    solve(2.0)
    memory = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return Times(
        forward=median_time(
            lambda: unprepared(state).moved_to(state.roller_positions + step), BUDGET
        ),
        factor=median_time(lambda: factorize(robot.constraints.matrix(state.points)), BUDGET),
        free=median_time(lambda: solve(0.5), BUDGET),
        limited=median_time(lambda: solve(2.0), BUDGET),
        regularized=median_time(lambda: solve(2.0, True), BUDGET),
        paper=median_time(lambda: paper.solve_kkt(given, 0.5 * limit), BUDGET),
        memory=memory,
    )


def tables() -> Iterator[Table]:
    """Yield the tables of the case."""
    rows = []
    for size in SIZES[1:]:  # with 3 modules (20) is singular
        description = nested_triangles(size)
        load, robot = timed(lambda file=description: core.Robot(file))
        found = measure(robot, top_module(description))
        ours = (
            found.forward,
            found.factor,
            found.free,
            found.limited,
            found.regularized,
            found.paper,
        )
        times = [f'{1e6 * time:.0f}' for time in ours]
        rows.append(
            [
                f'{size}',
                f'{robot.constraints.n_columns}',
                f'{1e3 * load:.1f}',
                *times,
                f'{found.paper / found.free:.1f}',
                f'{found.memory / 1024:.0f}',
            ]
        )
    header = (
        'modules',
        'coordinates',
        'make [ms]',
        'forward step',
        'matrix + factor',
        'free twist',
    )
    more = ('limited twist', 'in a loop', 'KKT', 'KKT / free', 'memory [kB]')
    title = 'Times in us. KKT: the free twist as the paper has it, (20) in the nodes.'
    yield Table(title, (*header, *more), rows)
