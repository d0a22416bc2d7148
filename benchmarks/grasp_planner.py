# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How often grasps are found, and for how many evaluations, against searches that know no structure.

Objects lie free inside a loop of the nine-member robot at home, 2 cm from everything at least;
places and diameters (0.15 to 0.5 m) are random, with a fixed seed. A grasp closes by friction 0.5
with a margin of 10 mN, and no tube bears more than 0.8 of its wrinkling moment.

The peers draw roller positions, up to 0.5 m from home: plain random sampling, and SciPy's
differential evolution on a sum of all that is missed: gaps between the object and the two sides
that are nearest to touching it, depth of what should not touch, lengths, rigidity, clearance, then
imbalance and margin. They need a shape only, no way to it. Each gets ten times the evaluations
that the planner took for the same object, up to 5000 of them. Every configuration counts as one
evaluation; the planner's analyses count besides, those of the peers do not.

    python benchmarks/grasp_planner.py [OBJECTS]
"""

from __future__ import annotations

from collections.abc import Callable
import os
import sys
import time
from typing import NamedTuple

os.environ.update(OPENBLAS_NUM_THREADS='1', OMP_NUM_THREADS='1')  # before NumPy comes in

from isotruss_ros.core import (
    analyze_grasp,
    Configuration,
    ConvexObject,
    GraspRequirements,
    IsotrussError,
    load_robot,
    plan_grasps,
)
from isotruss_ros.core.planning.closing import Closing
from isotruss_ros.core.planning.seeds import enclosing_members
from isotruss_ros.core.safety.margins import object_distances, shape_margins
from measuring import part, print_machine, print_table
import numpy as np
from scipy.optimize import differential_evolution

ROBOT = load_robot('nine_member')
NEEDS = GraspRequirements(min_margin=0.01, count=1)
SEED, OBJECTS = 0, part(50)
DIAMETERS, FREE = (0.15, 0.5), 0.02
#: The peers draw roller positions this far from home [m].
REACH = 0.5
#: The peers may look at this many times more configurations, and at so many in all.
ALLOWANCE, MOST = 10, part(5000)
#: Members that differential evolution keeps for each of the six rollers.
POPULATION = 10
#: The sides of a grasp press about as deep [m].
DEPTH = 0.03


class FoundError(Exception):
    """A peer has found a grasp: it may stop."""


class Outcome(NamedTuple):
    """What a search came to: whether it found a grasp, evaluations, and time [s]."""

    found: bool
    evaluations: int
    duration: float


def objects(count: int) -> list[ConvexObject]:
    """Return objects that lie free inside a loop of the robot at home."""
    draw, home = np.random.default_rng(SEED), ROBOT.home
    low, high = home.nodes.min(axis=0), home.nodes.max(axis=0)
    found: list[ConvexObject] = []
    while len(found) < count:
        body = ConvexObject.disc(tuple(draw.uniform(low, high)), draw.uniform(*DIAMETERS))
        if loop_around(home, body.center) and object_distances(home, body).min() >= FREE:
            found.append(body)
    return found


def loop_around(config: Configuration, point: complex) -> tuple[int, ...]:
    """Return the members around a point where all are of one tube, nothing elsewhere."""
    around = enclosing_members(config, point)
    return around if len({int(ROBOT.topology.tube[i]) for i in around}) == 1 else ()


def missed(positions: np.ndarray, body: ConvexObject) -> float:
    """Return how much a shape misses of a grasp, 0 for a grasp; smooth where that is possible."""
    file = ROBOT.description
    lengths = ROBOT.home.member_lengths + ROBOT.topology.incidence @ positions
    off = np.maximum(0.0, file.min_length - lengths) + np.maximum(0.0, lengths - file.max_length)
    if off.any():
        return 200.0 + float(off.sum())
    try:
        config = ROBOT.configuration(positions)
        return _missed(config, body)
    except IsotrussError:
        return 100.0


def _missed(config: Configuration, body: ConvexObject) -> float:
    margins, gaps = shape_margins(config), object_distances(config, body)
    members, modules, _ = gaps.reshape(3, -1)
    shape = (
        max(0.0, NEEDS.min_rigidity - margins.rigidity)
        + max(0.0, -margins.clearance)
        + np.maximum(0.0, -modules).sum()
    )
    around = loop_around(config, body.center)
    if len(around) < 2:
        return 50.0 + shape
    off = np.abs(members + DEPTH)
    sides = sorted(around, key=lambda i: off[i])[:2]
    others = np.delete(members, sides)
    one, other = Closing(body, tuple(sides), (), 0.0).normals(config)
    half_wedge = 0.5 * abs(np.angle(-other / one))
    wide = max(0.0, 2.0 * (half_wedge - 0.8 * np.arctan(NEEDS.friction)))
    shape += np.maximum(0.0, -others).sum()
    if members[sides].max() > -1e-3 or shape > 0.0:
        return 20.0 + 10.0 * (off[sides].sum() + shape) + wide
    found = analyze_grasp(config, body, NEEDS.friction)
    total = float(found.normal_forces.sum())
    if total == 0.0:
        return 20.0 + wide
    pressing = [found.contact_forces.get(ROBOT.member_names[i], 0.0) for i in sides]
    uneven = abs(pressing[0] - pressing[1]) / total
    short = max(0.0, NEEDS.min_margin - found.closure_margin)
    used = max(0.0, max(found.utilisation.values()) - NEEDS.max_utilisation)
    if short > 0.0 or used > 0.0 or not found.closed_by_friction:
        return uneven + wide + short / total + used + 1e-6
    return 0.0


def judge(positions: np.ndarray, body: ConvexObject) -> bool:
    """Check a grasp again: closed, and within the wrinkling moment."""
    found = analyze_grasp(ROBOT.configuration(positions), body, NEEDS.friction)
    return found.closed_by_friction and max(found.utilisation.values()) <= NEEDS.max_utilisation


def planned(body: ConvexObject) -> Outcome:
    """Let the planner search."""
    start = time.thread_time()
    plan = plan_grasps(ROBOT.home, body, NEEDS, SEED, thorough=False)
    duration = time.thread_time() - start
    if plan.grasps:
        assert judge(plan.grasps[0].roller_positions, body)
    return Outcome(bool(plan.grasps), plan.evaluations, duration)


def sampled(body: ConvexObject, budget: int) -> Outcome:
    """Draw roller positions."""
    draw = np.random.default_rng(SEED)
    start = time.thread_time()
    for count in range(1, budget + 1):
        positions = draw.uniform(-REACH, REACH, len(ROBOT.roller_names))
        if missed(positions, body) == 0.0 and judge(positions, body):
            return Outcome(True, count, time.thread_time() - start)
    return Outcome(False, budget, time.thread_time() - start)


def evolved(body: ConvexObject, budget: int) -> Outcome:
    """Let differential evolution search."""
    count = 0

    def objective(positions: np.ndarray) -> float:
        nonlocal count
        if count >= budget:
            raise FoundError
        count += 1
        value = missed(positions, body)
        if value == 0.0 and judge(positions, body):
            raise FoundError(positions)
        return value

    rollers = len(ROBOT.roller_names)
    start = time.thread_time()
    found = False
    try:
        differential_evolution(
            objective,
            [(-REACH, REACH)] * rollers,
            maxiter=budget,
            popsize=POPULATION,
            init='sobol',
            tol=0.0,
            polish=False,
            seed=SEED,
        )
    except FoundError as ended:
        found = bool(ended.args)
    return Outcome(found, count, time.thread_time() - start)


def main() -> None:
    """Search for all objects in all ways, and print what came of it."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else OBJECTS
    print_machine()
    rows: dict[str, list[Outcome]] = {'planner': [], 'random': [], 'evolution': []}
    peers: dict[str, Callable[[ConvexObject, int], Outcome]] = {
        'random': sampled,
        'evolution': evolved,
    }
    for body in objects(count):
        own = planned(body)
        rows['planner'].append(own)
        for name, search in peers.items():
            budget = min(ALLOWANCE * own.evaluations, MOST)
            rows[name].append(search(body, budget))
        if sys.stderr.isatty():
            print(f'{len(rows["planner"])} of {count}', end='\r', file=sys.stderr)
    own_total = sum(one.evaluations for one in rows['planner'])
    table = []
    for name, outcomes in rows.items():
        found = sum(one.found for one in outcomes)
        evaluations = sum(one.evaluations for one in outcomes)
        duration = sum(one.duration for one in outcomes)
        each = (f'{evaluations / found:.0f}', f'{duration / found:.2f}') if found else ('-', '-')
        table.append(
            (
                name,
                f'{found} of {count}',
                f'{np.median([one.evaluations for one in outcomes]):.0f}',
                f'{evaluations / own_total:.1f}',
                *each,
                f'{1e3 * duration / evaluations:.2f}',
            )
        )
    print_table(
        (
            'search',
            'found',
            'evaluations, median',
            'all, ratio',
            'for each found',
            's for each',
            'ms each',
        ),
        table,
    )


if __name__ == '__main__':
    main()
