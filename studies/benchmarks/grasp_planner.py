# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Success rate and evaluations of the grasp planner, compared with random sampling.

Objects are free inside a loop of the nine-member robot at home, at least 2 cm from all parts.
Positions and diameters (0.15 to 0.5 m) are random with a fixed seed. A grasp must hold the
object with a coefficient of friction of 0.5 and a utilisation of at most 0.8.

The peer tries random roller positions up to 0.5 m from home. It searches a configuration without a
path that leads to it. It may use ten times as many evaluations as the planner needs for the same
object, at most 5000. Each configuration counts as one evaluation. An analysis by the planner
counts as well, but not one by the peer.
"""

from __future__ import annotations

from collections.abc import Iterator
import time
from typing import NamedTuple

from isotruss_ros.core import (
    Configuration,
    ConvexObject,
    GraspRequirements,
    IsotrussError,
    load_robot,
    plan_grasps,
    settle_grasp,
)
from isotruss_ros.core.planning.seeds import enclosing_members
from isotruss_ros.core.safety.margins import object_distances, shape_margins
import numpy as np
from studies.benchmarks.measuring import part, Table

ROBOT = load_robot('nine_member')
NEEDS = GraspRequirements(count=1)
SEED, OBJECTS = 0, part(50)
DIAMETERS, FREE = (0.15, 0.5), 0.02
#: Largest roller travel of the peer from home [m].
REACH = 0.5
#: Evaluations of the peer relative to the planner, and their largest number [-].
ALLOWANCE, MOST = 10, part(5000)
#: Largest difference of the indentations of a grasp [m].
DEPTH = 0.03


class Outcome(NamedTuple):
    """Result of a search: success, evaluations, and time [s]."""

    found: bool
    evaluations: int
    duration: float


def objects(count: int) -> list[ConvexObject]:
    """Return free objects inside a loop of the robot at home."""
    draw, home = np.random.default_rng(SEED), ROBOT.home
    low, high = home.nodes.min(axis=0), home.nodes.max(axis=0)
    found: list[ConvexObject] = []
    while len(found) < count:
        body = ConvexObject.disc(tuple(draw.uniform(low, high)), draw.uniform(*DIAMETERS))
        if loop_around(home, body.center) and object_distances(home, body).min() >= FREE:
            found.append(body)
    return found


def loop_around(config: Configuration, point: complex) -> tuple[int, ...]:
    """Return the members around a point if all belong to one tube, else none."""
    around = enclosing_members(config, point)
    return around if len({int(ROBOT.topology.tube[i]) for i in around}) == 1 else ()


def missed(positions: np.ndarray, body: ConvexObject) -> bool:
    """Return whether roller positions have no configuration, or no grasp."""
    file = ROBOT.description
    lengths = ROBOT.home.member_lengths + ROBOT.topology.incidence @ positions
    if lengths.min() < file.min_length or lengths.max() > file.max_length:
        return True
    try:
        config = ROBOT.configuration(positions)
    except IsotrussError:
        return True
    margins, gaps = shape_margins(config), object_distances(config, body)
    members, modules, _ = gaps.reshape(3, -1)
    around = loop_around(config, body.center)
    if margins.rigidity < NEEDS.min_rigidity or margins.clearance < 0.0 or len(around) < 2:
        return True
    sides = sorted(around, key=lambda i: abs(members[i] + DEPTH))[:2]
    others = np.delete(members, sides)
    if modules.min() < 0.0 or others.min() < 0.0 or members[sides].max() > -1e-3:
        return True
    settled = settle_grasp(config, body, NEEDS.friction)
    return not settled.held or max(settled.utilisation.values()) > NEEDS.max_utilisation


def planned(body: ConvexObject) -> Outcome:
    """Search by the planner."""
    start = time.thread_time()
    plan = plan_grasps(ROBOT.home, body, NEEDS, SEED, thorough=False)
    duration = time.thread_time() - start
    return Outcome(bool(plan.grasps), plan.evaluations, duration)


def sampled(body: ConvexObject, budget: int) -> Outcome:
    """Search by random roller positions."""
    draw = np.random.default_rng(SEED)
    start = time.thread_time()
    for count in range(1, budget + 1):
        positions = draw.uniform(-REACH, REACH, len(ROBOT.roller_names))
        if not missed(positions, body):
            return Outcome(True, count, time.thread_time() - start)
    return Outcome(False, budget, time.thread_time() - start)


def tables() -> Iterator[Table]:
    """Yield the tables of the case."""
    rows: dict[str, list[Outcome]] = {'planner': [], 'random sampling': []}
    for body in objects(OBJECTS):
        own = planned(body)
        rows['planner'].append(own)
        budget = min(ALLOWANCE * own.evaluations, MOST)
        rows['random sampling'].append(sampled(body, budget))
    table = []
    for name, outcomes in rows.items():
        found = sum(one.found for one in outcomes)
        evaluations = sum(one.evaluations for one in outcomes)
        duration = sum(one.duration for one in outcomes)
        each = (f'{evaluations / found:.0f}', f'{duration / found:.2f}') if found else ('-', '-')
        table.append((name, f'{found} of {OBJECTS}', *each))
    yield Table('', ('search', 'found', 'evaluations each', 's each'), table)
