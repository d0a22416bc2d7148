# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Success rate and time of quadratic programs, compared with other solvers.

The programs come from walks along the bounds of configurations, and from grasp planning. They are
changed at random: targets by 1 %, bounds by half of their values or to zero, so that many meet at
a vertex, and equalities by a thousandth; one of ten equalities is almost parallel to another. A
program counts as not solved if there is no result, if its violation exceeds 1e-7, or if another
solver found a lower cost. x = 0 is always admissible.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy

from isotruss_ros.core import ConvexObject, load_robot, plan_grasps
from isotruss_ros.core.manipulation import limit_handling
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.qp import QuadraticProgram, solve_qp
from isotruss_ros.core.planning import approach
import numpy as np
import qpsolvers
from studies.benchmarks.measuring import part, Table, timed
import walks

PROGRAMS, KEPT, WALKS = part(20_000), 3000, part(30)
PEERS = {'daqp': {'primal_tol': 1e-9}, 'quadprog': {}}
SOURCES = {'twist': limit_handling, 'closing': approach}


def harvest() -> dict[str, list[QuadraticProgram]]:
    """Return the programs of walks and plans, by their source."""
    kept: dict[str, list[QuadraticProgram]] = {name: [] for name in SOURCES}
    for name, module in SOURCES.items():

        def record(problem: QuadraticProgram, name: str = name) -> Array | None:
            if len(kept[name]) < KEPT:
                kept[name].append(deepcopy(problem))
            return solve_qp(problem)

        module.solve_qp = record
    for seed in range(WALKS):
        walks.walk(seed, 300, slide=seed % 3 == 2)
    home = load_robot('nine_member').home
    for diameter in (0.2, 0.25, 0.3, 0.35, 0.4):
        plan_grasps(home, ConvexObject.disc((0.0, -0.8), diameter), thorough=False)
    return kept


def varied(problem: QuadraticProgram, rng: np.random.Generator) -> QuadraticProgram:
    """Return a variation of a program, with more constraints at one vertex."""
    shift = 1e-2 * rng.standard_normal(len(problem.gradient))
    bounds = problem.bounds * rng.uniform(0.5, 1.5, len(problem.bounds))
    # Bounds of rows that have none stay infinite, those of one variable are not zero. A bound of
    # zero would make a direction of rounding errors.
    varying = np.isfinite(bounds) & ((np.abs(problem.rows) > 1e-7).sum(axis=1) > 1)
    bounds[(rng.random(len(bounds)) < 0.2) & varying] = 0.0
    equality = problem.equality
    if equality is not None:
        equality = equality * (1.0 + 1e-3 * rng.standard_normal(equality.shape))
        if rng.random() < 0.1:
            equality[-1] = equality[0] + 1e-6 * equality[-1]
    gradient = problem.gradient + problem.hessian @ shift
    return problem._replace(gradient=gradient, bounds=bounds, equality=equality)


def by_peer(problem: QuadraticProgram, name: str) -> Array | None:
    """Solve a program by another solver; None if it refuses the program."""
    rows = len(problem.rows) > 0
    posed = qpsolvers.Problem(
        problem.hessian,
        problem.gradient,
        problem.rows if rows else None,
        problem.bounds if rows else None,
        problem.equality,
        problem.target,
    )
    try:
        return qpsolvers.solve_problem(posed, name, **PEERS[name]).x
    except qpsolvers.ProblemError:  # quadprog needs a positive definite matrix
        return None


def cost_of(problem: QuadraticProgram, x: Array | None) -> float:
    """Return the cost at a point; infinite if the point is not admissible."""
    if x is None:
        return np.inf
    sizes = np.abs(problem.rows).max(axis=1)
    beyond = ((problem.rows @ x - problem.bounds) / np.maximum(sizes, 1e-7)).max()
    if problem.equality is not None:
        beyond = max(beyond, np.abs(problem.equality @ x - problem.target).max())
    value = 0.5 * x @ problem.hessian @ x + problem.gradient @ x
    return np.inf if not beyond < 1e-7 else float(value)


def tables() -> Iterator[Table]:
    """Yield the tables of the case."""
    rng, programs = np.random.default_rng(1), harvest()
    solvers = {'this package': solve_qp}
    for peer in PEERS:
        solvers[peer] = lambda problem, peer=peer: by_peer(problem, peer)
    rows = []
    for source, posed in programs.items():
        left, times = dict.fromkeys(solvers, 0), {name: [] for name in solvers}
        for _ in range(PROGRAMS // len(programs)):
            problem = varied(posed[rng.integers(len(posed))], rng)
            costs = {}
            for name, solve in solvers.items():
                seconds, found = timed(lambda solve=solve, problem=problem: solve(problem))
                times[name].append(1e6 * seconds)
                costs[name] = cost_of(problem, found)
            least = min(costs.values())
            for name, cost in costs.items():
                left[name] += not cost <= least + 1e-5 * max(1.0, abs(least))
        for name in solvers:
            middle, high = np.quantile(times[name], [0.5, 0.99])
            rows.append((source, name, f'{left[name]}', f'{middle:.0f}', f'{high:.0f}'))
    title = f'{PROGRAMS // len(programs)} programs each, near ones that occurred.'
    yield Table(title, ('programs', 'solver', 'not solved', 'median [us]', 'p99 [us]'), rows)
