# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How loading, forward kinematics and twist-to-rollers grow from 3 to 300 modules, one core.

Robots of nested triangles (see large_robots.py). The second table compares dense with sparse
factors; `MAX_DENSE_COORDINATES` in core/constraints.py is its crossover.

    python benchmarks/scaling.py
"""

from __future__ import annotations

from dataclasses import dataclass
import os
from pathlib import Path
import tempfile
import tracemalloc

os.environ.update(OPENBLAS_NUM_THREADS='1', OMP_NUM_THREADS='1')  # before NumPy comes in

from isotruss_ros import core
from isotruss_ros.core.kinematics import constraints
from isotruss_ros.core.manipulation.limit_handling import LimitHandling
from isotruss_ros.core.manipulation.status import RollerCommand
from isotruss_ros.core.model.description import RobotDescription
from isotruss_ros.core.numerics.factorization import factorize
from kinematics import PaperProgram, State
from large_robots import nested_triangles, SIZES, top_module, write_robot_file
from measuring import median_time, print_machine, print_table, timed
import numpy as np

DIAMETER = 0.15
#: Random roller travel from home [m]; a hundred modules add up, so it is small.
TRAVEL = 0.02
#: Of the loop of the nodes [s].
PERIOD = 5e-3
#: How long to repeat each call [s].
BUDGET = 0.2
#: Sizes around the crossover from dense to sparse.
CROSSOVER_SIZES = (9, 15, 21, 27, 33, 39, 51, 75, 99, 201, 303)


@dataclass(frozen=True)
class Times:
    """Medians [s] on one robot."""

    forward: float  #: forward kinematics over one cycle at 200 Hz, full speed
    factor: float  #: matrix of (12) and its factorization
    free: float  #: twist to rollers where no limit binds
    limited: float  #: twist to rollers at twice of what the limits allow: as far as possible
    regularized: float  #: the same as the nodes have it, regularized for loops of 5 ms
    paper: float  #: the free twist as the paper's (20), one dense linear system; 0 if left out
    memory: int  #: peak of a limited twist [bytes]


def measure(robot: core.Robot, module: str, peer: bool = False) -> Times:
    """
    Measure one robot in a random state near home; no call finds anything prepared.

    :param module: the grip.
    :param peer: whether to measure the paper's program, too.
    """
    rng = np.random.default_rng(1)
    rollers = len(robot.roller_names)
    state = robot.configuration(rng.uniform(-TRAVEL, TRAVEL, rollers))
    step = robot.description.max_speed / 200.0 * rng.choice([-1.0, 1.0], rollers)
    body = core.ConvexObject.disc(core.tangent_center(state, module, DIAMETER), DIAMETER)
    grip = core.Grip.at_module(robot, module, body)
    twist = np.array([1.0, 0.5, 4.0])
    limit = core.solve_twist(state, grip, twist).scale * twist

    def fresh() -> core.Configuration:
        return core.Configuration(robot, state.roller_positions, state.points)

    def solve(size: float, period: float = 0.0) -> RollerCommand:
        return core.solve_twist(fresh(), grip, size * limit, handling=LimitHandling(period=period))

    solve(0.5)
    paper = PaperProgram(robot)
    given = State(state, grip, limit)
    tracemalloc.start()
    solve(2.0)
    memory = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return Times(
        forward=median_time(lambda: fresh().moved_to(state.roller_positions + step), BUDGET),
        factor=median_time(lambda: factorize(robot.constraints.matrix(state.points)), BUDGET),
        free=median_time(lambda: solve(0.5), BUDGET),
        limited=median_time(lambda: solve(2.0), BUDGET),
        regularized=median_time(lambda: solve(2.0, PERIOD), BUDGET),
        paper=median_time(lambda: paper.solve_kkt(given, 0.5 * limit), BUDGET) if peer else 0.0,
        memory=memory,
    )


def load_time(description: RobotDescription, folder: Path) -> float:
    """Return the time that it takes to load a robot from its file [s]."""
    path = folder / f'{description.name}.yaml'
    path.write_text(write_robot_file(description), encoding='utf-8')
    return min(timed(lambda: core.load_robot(path))[0] for _ in range(3))


def with_factors(description: RobotDescription, dense: bool) -> core.Robot:
    """Make a robot that uses dense or sparse factors whatever its size."""
    chosen = constraints.MAX_DENSE_COORDINATES
    try:
        constraints.MAX_DENSE_COORDINATES = 1_000_000 if dense else 0
        return core.Robot(description)
    finally:
        constraints.MAX_DENSE_COORDINATES = chosen


def growth() -> None:
    """Print how everything grows with the number of modules."""
    rows: list[list[str]] = []
    sizes: list[int] = []
    times: list[list[float]] = []
    with tempfile.TemporaryDirectory() as folder:
        for n_modules in SIZES:
            description = nested_triangles(n_modules)
            load = load_time(description, Path(folder))
            robot = core.Robot(description)
            found = measure(robot, top_module(description), peer=n_modules > 3)
            sizes.append(n_modules)
            ours = [found.forward, found.free, found.limited, found.regularized]
            times.append([load, *ours, found.paper])
            nine = times[min(1, len(times) - 1)]
            rows.append(
                [
                    str(n_modules),
                    str(robot.constraints.n_columns),
                    f'{1e3 * load:.1f}',
                    *(
                        text
                        for time, base in zip(times[-1][1:5], nine[1:5], strict=True)
                        for text in (
                            f'{1e6 * time:.0f}',
                            f'{time / base:.1f}' if n_modules >= 9 else '',
                        )
                    ),
                    f'{1e6 * found.paper:.0f}' if found.paper else '-',
                    f'{found.paper / found.free:.1f}' if found.paper else '-',
                    f'{found.memory / 1024:.0f}',
                ]
            )
    # Small robots cost what Python calls cost, so they say nothing about growth.
    large = np.array(sizes) >= 99
    exponents = np.polyfit(np.log(np.array(sizes)[large]), np.log(np.array(times)[large]), 1)[0]
    load, *grown, paper = (f'{exponent:.1f}' for exponent in exponents)
    grown_and_gaps = [text for exponent in grown for text in (exponent, '')]
    rows.append(['exponent from 99 on', '', load, *grown_and_gaps, paper, '', ''])
    print('Times in us (loading: ms); "/ 9": ratio to 9 modules; a twist at half and at twice of')
    print('what the limits allow, the latter as far as possible and as in a loop of 5 ms; "KKT":')
    print('the free twist as the paper has it, (20) in the nodes, by numpy.linalg.solve, with its')
    print('ratio to ours; memory: peak of a limited twist [kB].\n')
    header = ['modules', 'coordinates', 'load', 'forward step', '/ 9', 'free twist', '/ 9']
    header += ['limited twist', '/ 9', 'for 5 ms', '/ 9']
    print_table([*header, 'KKT', 'ratio', 'memory'], rows)


def crossover() -> None:
    """Print dense and sparse side by side."""
    rows: list[list[str]] = []
    for n_modules in CROSSOVER_SIZES:
        description = nested_triangles(n_modules)
        module = top_module(description)
        dense = measure(with_factors(description, dense=True), module)
        sparse = measure(with_factors(description, dense=False), module)
        coordinates = with_factors(description, dense=True).constraints.n_columns
        rows.append(
            [
                str(n_modules),
                str(coordinates),
                *(
                    text
                    for a, b in (
                        (dense.factor, sparse.factor),
                        (dense.forward, sparse.forward),
                        (dense.free, sparse.free),
                    )
                    for text in (f'{1e6 * a:.0f}', f'{1e6 * b:.0f}', f'{a / b:.2f}')
                ),
            ]
        )
    print('\nDense and sparse [us], ratio dense / sparse; matrix and factor, forward step, free')
    print(f'twist. MAX_DENSE_COORDINATES is {constraints.MAX_DENSE_COORDINATES} coordinates.\n')
    names = ('matrix+factor', 'forward', 'twist')
    columns = [text for name in names for text in (f'{name}: dense', 'sparse', 'ratio')]
    print_table(['modules', 'coordinates', *columns], rows)


def main() -> None:
    """Print both tables."""
    print_machine()
    growth()
    crossover()


if __name__ == '__main__':
    main()
