# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How often and how fast quadratic programs are solved, beside other solvers.

Programs come from walks at the edge of the shapes and from the planning of grasps. Each is varied:
targets by 1 %, bounds by half of themselves or to zero, so that many meet at a corner, equalities
by a thousandth, one in ten of them next to parallel. Counted is what is not solved: no answer, one
that is beyond a constraint by 1e-7, or one that costs more than duality shows to be the least;
x = 0 is always admissible.

    python benchmarks/qp_solvers.py [PROGRAMS [SEED]]
"""

from __future__ import annotations

import os
from pathlib import Path
import sys
import time

os.environ.update(OPENBLAS_NUM_THREADS='1', OMP_NUM_THREADS='1')  # before NumPy comes in
sys.path.append(str(Path(__file__).parents[1]))
sys.path.append(str(Path(__file__).parents[1] / 'test' / 'helpers'))

from isotruss_ros.core import ConvexObject, load_robot, plan_grasps
from isotruss_ros.core.manipulation import twist_qp
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.qp import QuadraticProgram, solve_qp
from isotruss_ros.core.planning import closing_step
from measuring import part, print_machine, print_table
import numpy as np
import qpsolvers
from scipy.optimize import lsq_linear, nnls
import walks

PROGRAMS, KEPT, WALKS = part(20_000), 3000, part(30)
PEERS = {'daqp': {'primal_tol': 1e-9}, 'quadprog': {}}
SOURCES = {'twist': twist_qp, 'closing': closing_step}


def harvest() -> dict[str, list[QuadraticProgram]]:
    """Return programs by source, as walks and plans pose them."""
    kept: dict[str, list[QuadraticProgram]] = {name: [] for name in SOURCES}
    for name, module in SOURCES.items():

        def record(problem: QuadraticProgram, name: str = name) -> Array | None:
            if len(kept[name]) < KEPT:
                kept[name].append(QuadraticProgram(*(copied(part) for part in problem)))
            return solve_qp(problem)

        module.solve_qp = record
    for seed in range(WALKS):
        walks.walk(seed, 300, slide=seed % 3 == 2)
    home = load_robot('nine_member').home
    for diameter in (0.2, 0.25, 0.3, 0.35, 0.4):
        plan_grasps(home, ConvexObject.disc((0.0, -0.8), diameter), thorough=False)
    return kept


def copied(part: Array | None) -> Array | None:
    """Return a copy of a part of a program."""
    return None if part is None else np.array(part)


def varied(problem: QuadraticProgram, rng: np.random.Generator) -> QuadraticProgram:
    """Return a program near one that occurred, with more constraints in one corner."""
    shift = 1e-2 * rng.standard_normal(len(problem.gradient))
    bounds = problem.bounds * rng.uniform(0.5, 1.5, len(problem.bounds))
    # Bounds of rows that have none stay infinite, those of one variable are not zero.
    varying = np.isfinite(bounds) & ((problem.rows != 0.0).sum(axis=1) > 1)
    bounds[(rng.random(len(bounds)) < 0.2) & varying] = 0.0
    equality = problem.equality
    if equality is not None:
        equality = equality * (1.0 + 1e-3 * rng.standard_normal(equality.shape))
        if rng.random() < 0.1:
            equality[-1] = equality[0] + 1e-6 * equality[-1]
    gradient = problem.gradient + problem.hessian @ shift
    return problem._replace(gradient=gradient, bounds=bounds, equality=equality)


def by_peer(problem: QuadraticProgram, name: str) -> Array | None:
    """Solve a program by another solver."""
    rows = len(problem.rows) > 0
    return qpsolvers.solve_problem(
        qpsolvers.Problem(
            problem.hessian,
            problem.gradient,
            problem.rows if rows else None,
            problem.bounds if rows else None,
            problem.equality,
            problem.target,
            problem.lower,
            problem.upper,
        ),
        name,
        **PEERS[name],
    ).x


def cost_of(problem: QuadraticProgram, x: Array | None) -> float:
    """Return the cost at a point, infinite where it is none or not admissible."""
    if x is None:
        return np.inf
    rows, bounds, equality, target = constraints(problem)
    beyond = max((rows @ x - bounds).max(), np.abs(equality @ x - target).max(initial=0.0))
    value = 0.5 * x @ problem.hessian @ x + problem.gradient @ x
    return np.inf if not beyond < 1e-7 else float(value)


def least_cost(problem: QuadraticProgram, x: Array) -> float:
    """Return what no admissible point costs less than, by multipliers that fit a point best."""
    rows, bounds, equality, target = constraints(problem)
    lengths, k = np.linalg.norm(rows, axis=1), len(equality)
    active = (bounds - rows @ x < 1e-8) & (lengths > 1e-12 * lengths.max(initial=0.0))
    matrix = np.concatenate([equality, rows[active]])
    right = np.concatenate([target, bounds[active]])
    root, slope = np.linalg.cholesky(problem.hessian), problem.hessian @ x + problem.gradient
    left, turned = np.linalg.solve(root, slope), np.linalg.solve(root, matrix.T)
    basis, factor = np.linalg.qr(turned[:, :k], 'complete')
    pushing, free = turned[:, k:], basis[:, k:].T
    sizes = np.maximum(np.linalg.norm(free @ pushing, axis=0), np.finfo(float).tiny)
    pushes = nonnegative(free @ pushing / sizes, -free @ left) / sizes
    left = left + pushing @ pushes
    holds = -np.linalg.solve(factor[:k], basis[:, :k].T @ left)
    left = left + turned[:, :k] @ holds
    # What rounding leaves of constraints, times multipliers that may be large, is no cost.
    digits = 2 * len(x) * np.finfo(float).eps * (np.abs(matrix) @ np.abs(x) + np.abs(right))
    multipliers = np.concatenate([holds, pushes])
    value = 0.5 * x @ (slope + problem.gradient) + multipliers @ (matrix @ x - right)
    return float(value + np.abs(multipliers) @ digits - 0.5 * left @ left)


def nonnegative(matrix: Array, right: Array) -> Array:
    """Return x >= 0 with the least |matrix x - right|."""
    if matrix.size == 0:
        return np.zeros(matrix.shape[1])
    try:
        return nnls(matrix, right)[0]
    except RuntimeError:
        return lsq_linear(matrix, right, (0.0, np.inf), 'bvls').x


def is_least(cost: float, least: float) -> bool:
    """Return whether a cost is the least, but for 1e-5."""
    return cost <= least + 1e-5 * max(1.0, abs(least))


def constraints(problem: QuadraticProgram) -> tuple[Array, Array, Array, Array]:
    """Return rows and bounds of all inequalities and of the equalities."""
    rows, bounds, n = problem.rows, problem.bounds, len(problem.gradient)
    if problem.lower is not None:
        rows = np.concatenate([rows, np.eye(n), -np.eye(n)])
        bounds = np.concatenate([bounds, problem.upper, -problem.lower])
    if problem.equality is None:
        return rows, bounds, np.zeros((0, n)), np.zeros(0)
    return rows, bounds, problem.equality, problem.target


def main() -> None:
    """Print how many programs each solver left, and its median time."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else PROGRAMS
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    print_machine()
    rng, programs = np.random.default_rng(seed), harvest()
    solvers = {'this package': solve_qp}
    for peer in PEERS:
        solvers[peer] = lambda problem, peer=peer: by_peer(problem, peer)
    for source, posed in programs.items():
        left, times = dict.fromkeys(solvers, 0), {name: [] for name in solvers}
        for _ in range(count // len(programs)):
            problem = varied(posed[rng.integers(len(posed))], rng)
            costs, least = {}, -np.inf
            for name, solve in solvers.items():
                start = time.thread_time_ns()
                found = solve(problem)
                times[name].append(1e-3 * (time.thread_time_ns() - start))
                costs[name] = cost_of(problem, found)
                if costs[name] < np.inf and not is_least(costs[name], least):
                    least = max(least, least_cost(problem, found))
            for name, cost in costs.items():
                left[name] += not is_least(cost, least)
        rows = [
            (
                name,
                str(left[name]),
                f'{np.median(times[name]):.0f}',
                f'{np.quantile(times[name], 0.99):.0f}',
            )
            for name in solvers
        ]
        print(f'\n{source}: {count // len(programs)} programs near {len(posed)} that occurred')
        print_table(('solver', 'not solved', 'median [us]', 'p99 [us]'), rows)


if __name__ == '__main__':
    main()
