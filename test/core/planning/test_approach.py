# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bringing a grip to an object: the way there is free, and is what the search says it is."""

from dataclasses import replace
import functools
import itertools
from typing import NamedTuple

import closings
from isotruss_ros.core import GraspRequirements
from isotruss_ros.core.planning import approach as approaching
from isotruss_ros.core.planning.approach import Closing
from isotruss_ros.core.planning.facing import balances
from isotruss_ros.core.planning.seeds import find_seeds
from isotruss_ros.core.planning.violations import RequirementError, SearchTally
from nightly import some_now
import numpy as np
import pytest


def between(path, pieces=4):
    """Return configurations on a way, with those between its rows, and the row before each."""
    for row, (one, other) in enumerate(itertools.pairwise(path)):
        config = one
        for share in np.arange(pieces) / pieces:
            goal = one.roller_positions + share * (other.roller_positions - one.roller_positions)
            config = config.moved_to(goal)
            yield row, config
    yield len(path) - 1, path[-1]


NEEDS = GraspRequirements()
#: First those of which approaches are refused for three reasons.
SEEDS = some_now([((0, 3, 4),), (range(5),)])


class Way(NamedTuple):
    """What closes, the path to it, what is not met, and how many configurations it took."""

    closing: Closing
    path: list
    unmet: tuple | None
    evaluations: int


def approach(config, closing):
    """Approach an object."""
    closing, path, unmet = replace(closing, tally=SearchTally()), [], None
    try:
        for there in approaching.approach(config, closing):
            path.append(there)
    except RequirementError as error:
        unmet = error.args
    return Way(closing, path, unmet, closing.tally.evaluations)


@functools.lru_cache(maxsize=64)
def reached(seed):
    """Return an object in a robot, and some approaches to it."""
    config, body, _ = closings.scene(seed)
    found = find_seeds(config, body, NEEDS, 0, 0)
    found += find_seeds(config, body, NEEDS, 0, 1)[:2]
    return config, body, [approach(config, closing) for closing in found]


def each(seeds, arrived):
    """Return every approach of some seeds that arrived, or did not, with the object."""
    found = [(body, way) for _, body, ways in map(reached, seeds) for way in ways]
    return [(body, way) for body, way in found if (way.unmet is None) == arrived]


def standing(way, config):
    """Return the largest distance of the sides that are to touch from their standoff [m]."""
    members, *_ = closings.gaps(config, way.closing.body)
    return members[list(way.closing.members)].max() - 0.06 * config.robot.description.tube_diameter


def is_balanced(way, config):
    """Return whether friction holds the object between the sides."""
    normals = way.closing.normals(config)
    radius = 0.5 * config.robot.description.tube_diameter
    return balances(way.closing.body, normals, 0.85 * way.closing.friction_angle, radius)


@pytest.mark.parametrize('seeds', SEEDS)
def test_sides_stand_off_the_object_and_friction_holds_it_between_them(seeds):
    assert len(each(seeds, arrived=True)) >= 7
    for body, way in each(seeds, arrived=True):
        there = way.path[-1]
        tube = there.robot.description.tube_diameter
        near = closings.gaps(there, body)[0][list(way.closing.members)]
        assert near.min() > 0.06 * tube - 0.016 * tube
        assert near.max() <= 0.08 * tube + 3e-5
        assert is_balanced(way, there)


@pytest.mark.parametrize('seeds', SEEDS)
def test_way_is_free_of_the_object_between_its_rows_too(seeds):
    for body, way in each(seeds, arrived=True):
        count = len(way.path[0].robot.member_names)
        others = [i for i in range(count) if i not in way.closing.members]
        began = min(np.concatenate(closings.gaps(way.path[0], body)))
        for _, config in between(way.path, 3):
            members, *modules = closings.gaps(config, body)
            assert members.min() > 0.0
            tube = config.robot.description.tube_diameter
            # What is not to touch keeps away; a side that is to touch comes no nearer than asked.
            least = min(members[others].min(), np.min(modules))
            assert least > min(0.05 * tube, began) - 0.01 * tube


@pytest.mark.parametrize('seeds', SEEDS)
def test_reported_violations_are_true(seeds):
    names = set()
    for _, way in each(seeds, arrived=False):
        name, value, _ = way.unmet
        there, tube = way.path[-1], way.path[-1].robot.description.tube_diameter
        gap = standing(way, there)
        if name == 'reach':
            assert value == pytest.approx(gap, abs=3e-5)
            assert gap > 0.02 * tube
        elif name == 'facing':
            assert value > 0.0
            assert not is_balanced(way, there)
            assert gap <= 0.02 * tube + 3e-5
        names.add(name)
    assert {'reach', 'facing', 'object_clearance'} <= names
    assert names <= {'reach', 'facing', 'rigidity', 'self_clearance', 'object_clearance'}


def test_a_posture_draws_what_the_task_leaves_free():
    config, _, ways = reached(0)
    closing = next(way for way in ways if way.unmet is None).closing
    rng, start = np.random.default_rng(0), config.roller_positions
    for _ in range(2):
        away = 0.2 * rng.standard_normal(len(start))
        pulled = [
            approach(config, replace(closing, nominal_posture=start + s * away))
            for s in (1.0, -1.0)
        ]
        one, other = (way.path[-1].roller_positions for way in pulled)
        assert (one - other) @ away > 0.0
