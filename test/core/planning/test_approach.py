# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Bringing a grip to an object: the way there is free, and is what the search says it is."""

from dataclasses import replace
import functools
import itertools
from typing import NamedTuple

import closings
from isotruss_ros.core import ConvexObject, Disc, GraspRequirements, load_robot, plan_grasps
from isotruss_ros.core.planning import approach as approaching
from isotruss_ros.core.planning.approach import find_turn
from isotruss_ros.core.planning.closing import Closing
from isotruss_ros.core.planning.facing import balances, friction_angles
from isotruss_ros.core.planning.grasp_plan import SearchTally
from isotruss_ros.core.planning.seeds import find_seeds
import numpy as np
import pytest

HOME = load_robot('nine_member').home
SEEDS = range(5)
NEEDS = GraspRequirements()


class Way(NamedTuple):
    """What closes, the path to it, what is not met, and how many configurations it took."""

    closing: Closing
    path: tuple
    unmet: tuple | None
    evaluations: int


def approach(config, closing, should_stop=None):
    """Approach an object."""
    closing = replace(closing, tally=SearchTally())
    path, unmet = approaching.approach(config, closing, should_stop)
    return Way(closing, path, unmet, closing.tally.evaluations)


@functools.lru_cache(maxsize=64)
def reached(seed):
    """Return an object in a robot, and some approaches to it."""
    config, body, _ = closings.scene(seed)
    found = find_seeds(config, body, NEEDS, 0, 0)
    found += find_seeds(config, body, NEEDS, 0, 1)[:2]
    ways = [approach(config, closing) for closing in found]
    return config, body, ways


def each(kept):
    """Return every approach of all seeds that is to be looked at, with the object."""
    return [(body, way) for config, body, ways in map(reached, SEEDS) for way in ways if kept(way)]


def arrived(way):
    """Tell whether the sides came to the object."""
    return way.unmet is None


def standing(way, config):
    """Return the largest distance of the sides that are to touch from their standoff [m]."""
    members, *_ = closings.gaps(config, way.closing.body)
    return members[list(way.closing.members)].max() - 0.06 * config.robot.description.tube_diameter


def missing(way, config):
    """Return by how much the sides are to turn yet [rad]."""
    return find_turn(config, way.closing)[0]


def test_there_are_approaches_of_all_kinds():
    counts = [len(each(arrived)), len(each(lambda way: not arrived(way)))]
    assert min(counts) >= 7
    missed = {way.unmet[0] for _, way in each(lambda way: not arrived(way))}
    assert {'reach', 'object_clearance'} <= missed


def test_sides_stand_off_the_object_and_friction_holds_it_between_them():
    for body, way in each(arrived):
        there = way.path[-1]
        tube = there.robot.description.tube_diameter
        near = closings.gaps(there, body)[0][list(way.closing.members)]
        assert near.min() > 0.06 * tube - 0.016 * tube
        assert near.max() <= 0.08 * tube + 3e-5
        normals = way.closing.normals(there)
        assert balances(body, normals, 0.85 * way.closing.friction_angle)


def test_way_is_free_of_the_object_between_its_rows_too():
    for body, way in each(arrived):
        count = len(way.path[0].robot.member_names)
        others = [i for i in range(count) if i not in way.closing.members]
        for _, config in closings.between(way.path, 3):
            members, *modules = closings.gaps(config, body)
            assert members.min() > 0.0
            tube = config.robot.description.tube_diameter
            # What is not to touch keeps away; a side that is to touch comes no nearer than asked.
            least = min(members[others].min(), np.min(modules))
            began = min(np.concatenate(closings.gaps(way.path[0], body)))
            assert least > min(0.05 * tube, began) - 0.01 * tube


def test_way_begins_where_the_robot_is_and_is_nothing_where_it_is_there():
    for _, way in each(arrived):
        again = approach(way.path[-1], way.closing)
        assert again.unmet is None
        assert again.path == [way.path[-1]]
        assert again.evaluations == 0
    for config, _, ways in map(reached, SEEDS):
        assert all(way.path[0] is config for way in ways)


def test_what_is_missed_is_so():
    for _, way in each(lambda way: not arrived(way)):
        name, value, _ = way.unmet
        there, tube = way.path[-1], way.path[-1].robot.description.tube_diameter
        gap = standing(way, there)
        if name == 'reach':
            assert value == pytest.approx(gap, abs=3e-5)
            assert gap > 0.02 * tube
        elif name == 'facing':
            assert value == missing(way, there) > 0.0
            assert gap <= 0.02 * tube + 3e-5
        else:
            assert name in ('rigidity', 'self_clearance', 'object_clearance')


def test_who_gets_nowhere_is_given_up_and_who_gets_on_is_not():
    for _, way in each(lambda way: True):
        left = [
            max(standing(way, config), 0.0) / config.robot.description.tube_diameter
            + missing(way, config)
            for config in way.path
        ]
        least = np.minimum.accumulate(left)
        slow = np.append(False, left[1:] > least[:-1] - 0.02 + 1e-4)
        quick = np.append(True, left[1:] < least[:-1] - 0.02 - 1e-4)
        # Thirteen slow steps in a row are the end.
        runs = [len(list(run)) for is_slow, run in itertools.groupby(slow) if is_slow]
        assert max(runs, default=0) <= 13
        if not arrived(way) and way.unmet[0] in ('reach', 'facing') and len(way.path) <= 100:
            assert not quick[-13:].any()
            assert len(way.path) > 13


def test_an_approach_ends_after_the_largest_number_of_steps(monkeypatch):
    _, _, ways = reached(0)
    way = max((way for way in ways if arrived(way)), key=lambda way: len(way.path))
    steps = len(way.path) - 1
    assert steps > 3
    monkeypatch.setattr(approaching, 'MAX_STEPS', steps)
    enough = approach(way.path[0], way.closing)
    monkeypatch.setattr(approaching, 'MAX_STEPS', steps - 1)
    short = approach(way.path[0], way.closing)
    assert enough.unmet is None
    assert len(short.path) == steps
    assert short.unmet[0] in ('reach', 'facing')


def test_a_caller_who_wants_to_stop_waits_for_one_step_at_most():
    _, _, ways = reached(0)
    way = max((way for way in ways if arrived(way)), key=lambda way: len(way.path))
    for steps in (0, 1, 3):
        asked = iter(range(100))
        stopped = approach(way.path[0], way.closing, lambda: next(asked) == steps)  # noqa: B023
        assert len(stopped.path) == steps + 1
        assert stopped.unmet[0] in ('reach', 'facing')
        for one, other in zip(stopped.path, way.path, strict=False):
            assert (one.roller_positions == other.roller_positions).all()
    # Who is there already is not stopped.
    assert approach(way.path[-1], way.closing, lambda: True).unmet is None


def test_a_search_hears_of_it_on_the_way_to_its_first_grip():
    config, body, ways = reached(0)
    asked = []

    def stop():
        asked.append(None)
        return len(asked) > 3

    plan = plan_grasps(config, body, NEEDS, should_stop=stop)
    assert not plan.complete
    assert len(asked) == 4
    # Not even the first of the branches came to its end.
    assert 0 < plan.evaluations < ways[0].evaluations
    assert plan.closest_violation is not None


def test_a_posture_draws_what_the_task_leaves_free():
    config, _, ways = reached(0)
    closing = next(way for way in ways if arrived(way)).closing
    rng, start = np.random.default_rng(0), config.roller_positions
    for _ in range(3):
        away = 0.2 * rng.standard_normal(len(start))
        pulled = [
            approach(config, replace(closing, nominal_posture=start + s * away))
            for s in (1.0, -1.0)
        ]
        one, other = (way.path[-1].roller_positions for way in pulled)
        assert (one - other) @ away > 0.0


def test_members_turn_to_where_friction_holds_to_spare():
    config, body = HOME, ConvexObject(Disc(0.2), (0.716, 0.43, 0.0))
    members = tuple(config.robot.member_names.index(name) for name in ('north/P-Z', 'north/Z-R'))
    closing = Closing(body, members, (), 0.0, 0.4, facing=np.exp([0.3j, 2.0j]))
    wide = replace(closing, friction_angle=3.0)
    missing, turned = find_turn(config, wide)
    assert (missing, turned.facing) == (0.0, None)
    missing, turned = find_turn(config, closing)
    way = np.angle(closing.facing * closing.normals(config).conj())
    assert missing == pytest.approx(np.abs(way).sum())
    assert friction_angles(body, turned.facing[:1], turned.facing[1:])[0] <= 0.75 * 0.4 + 1e-9


def test_members_with_nothing_to_turn_to_are_off_by_half_a_turn():
    body = ConvexObject.disc((0.6, 0.3), 0.3)
    names = HOME.robot.member_names
    apart = tuple(names.index(name) for name in ('north/P-Z', 'north/Z-R'))
    closing = Closing(body, apart, (), 0.1, 0.01)
    assert closing.facing is None
    assert find_turn(HOME, closing)[0] == np.pi
    assert find_turn(HOME, replace(closing, friction_angle=3.0))[0] == 0.0
