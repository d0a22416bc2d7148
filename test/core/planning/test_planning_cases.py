# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Rare ends of a search: nowhere to close, nothing to turn to, no time left."""

from concurrent.futures import Future
from dataclasses import replace
import math
from types import SimpleNamespace

from isotruss_ros.core import (
    ConvexObject,
    Disc,
    Ellipse,
    GraspRequirements,
    HoldStatus,
    load_robot,
    plan_grasps,
    Pose,
)
from isotruss_ros.core.planning import closing_in_place, grasp_search, release, squeeze
from isotruss_ros.core.planning import searcher as searchers
from isotruss_ros.core.planning.approach import approach, missing_turn
from isotruss_ros.core.planning.closing import Closing, evaluate_state
from isotruss_ros.core.planning.closing_in_place import ClosingInPlace
from isotruss_ros.core.planning.closing_motion import press, Pressing
from isotruss_ros.core.planning.facing import find_facing
from isotruss_ros.core.planning.grasp_plan import GraspPlan, Violation
from isotruss_ros.core.planning.motion_in_place import MotionInPlace
from isotruss_ros.core.planning.release import plan_release
from isotruss_ros.core.planning.searcher import Outcome, Searcher
from isotruss_ros.core.planning.seeds import find_seeds
from isotruss_ros.core.planning.settings import DEFAULT
from isotruss_ros.core.planning.squeeze import Pressed, Squeeze
from isotruss_ros.core.planning.surrounding import squeeze_around
import numpy as np
import pytest

HOME = load_robot('nine_member').home
BODY = ConvexObject.disc((0.6, 0.3), 0.3)
NEEDS = GraspRequirements(module='north/Z')
MEMBERS = ('north/Z-R', 'north/P-Z')
SEED = find_seeds(HOME, BODY, NEEDS, 0, 0)[0]
#: Members of three tubes around a disc, next to touching it.
AROUND = ('south/P-Q', 'east/Q-R', 'north/R-P')
DISC = ConvexObject(Disc(0.6), (0.716, -0.4134, 0.2))
BEYOND = Violation('reach', 0.1, 0.0, 40.1)


def numbers(names):
    """Return the numbers of members."""
    return tuple(HOME.robot.member_names.index(name) for name in names)


def closing_of_three():
    """Return what closes three members around a disc."""
    return Closing(DISC, numbers(AROUND), (), 0.1)


def pressing_only(times, monkeypatch, module):
    """Let members press so often in the place where they are, then no more."""
    left = [times]

    def press(config, closing, depths):
        left[0] -= 1
        return Pressing(config, 3) if left[0] >= 0 else Pressing(None, 5, BEYOND)

    monkeypatch.setattr(module, 'press', press)


@pytest.mark.parametrize('times', [0, 1])
@pytest.mark.parametrize('count', [2, 3])
def test_members_that_cannot_press_close_no_grip(times, count, monkeypatch):
    pressing_only(times, monkeypatch, closing_in_place)
    closing = SEED if count == 2 else closing_of_three()
    search = ClosingInPlace(HOME, closing, NEEDS)
    assert search.close() is None
    assert search.closest_violation == BEYOND
    assert search.evaluations == 3 * times + 5


@pytest.mark.parametrize('count', [2, 3])
def test_an_object_that_touches_nothing_is_not_held(count, monkeypatch):
    pressing_only(9, monkeypatch, closing_in_place)
    monkeypatch.setattr(closing_in_place, 'attach_grip', lambda *_: HoldStatus.NO_CONTACT)
    search = ClosingInPlace(HOME, SEED if count == 2 else closing_of_three(), NEEDS)
    assert search.close() is None
    violation = search.closest_violation
    assert (violation.requirement, violation.value, violation.bound) == ('held', 0.0, 1.0)
    assert search.analyses == 0


@pytest.mark.parametrize('steps', [1, 4])
def test_three_members_press_first_so_that_the_object_stays(steps, monkeypatch):
    monkeypatch.setattr(closing_in_place, 'MAX_BALANCE_STEPS', steps)
    settings = replace(DEFAULT, first_contact=1e-2)
    (seed,) = find_seeds(HOME, DISC, GraspRequirements(members=AROUND), 0, 0, settings)
    reached = approach(HOME, seed)
    search = ClosingInPlace(reached.path[-1], reached.closing, NEEDS)
    held = next(search._rise(search._press(reached.path[-1], np.zeros(3))))
    # As deep as each other they would push it aside.
    away = math.dist(held.pose[:2], DISC.pose[:2])
    assert away > 5e-4 if steps == 1 else away < 1e-4


def test_a_path_that_cannot_be_pressed_closes_no_grip(monkeypatch):
    pressing_only(2, monkeypatch, squeeze)
    search = Squeeze(HOME, SEED, NEEDS)
    pressed = Pressed(HOME, None, None, None, np.full(2, 0.01))
    assert search.closing_path(pressed) == ()
    assert search.closest_violation == BEYOND


def test_an_indifferent_grip_is_not_squeezed():
    motion = MotionInPlace(closing_of_three())
    grasp = SimpleNamespace(response=None, squeeze=3.0)
    assert squeeze_around(motion, grasp, 10.0) is None
    violation = motion.closest_violation
    assert (violation.requirement, violation.bound) == ('squeeze', 10.0)


def test_an_ellipse_askew_is_held_from_no_direction_without_friction():
    body = ConvexObject(Ellipse((0.2, 0.1)), Pose(0.0, 0.0, 0.1234))
    normals = np.array([1.0, -1.0 + 0j])
    assert find_facing(body, normals, 0.0, 0.5) is None
    assert find_facing(body, normals, 0.3, 0.5) is not None


def test_members_with_nothing_to_turn_to_are_off_by_half_a_turn():
    apart = numbers(('north/P-Z', 'north/Z-R'))
    closing = Closing(BODY, apart, (), 0.1, 0.01)
    assert closing.facing is None
    state = evaluate_state(HOME, BODY)
    assert missing_turn(state, closing) == np.pi
    assert missing_turn(state, replace(closing, friction_angle=3.0)) == 0.0


def test_members_that_cannot_open_so_far_do_not_let_go():
    there = approach(HOME, SEED).path[-1]
    near, far = (plan_release(there, BODY, MEMBERS, away) for away in (0.03, 3.0))
    assert near.violation is None
    assert near.apart == 1
    assert far.violation is not None
    assert len(far.path) == 0


class Never:
    """An executor that never comes to what it has been given."""

    def __init__(self):
        self.futures = []

    def submit(self, *_):
        self.futures.append(Future())
        return self.futures[-1]


def test_a_search_that_waits_for_others_stops_when_it_is_told_to():
    executor, asked = Never(), []

    def should_stop():
        asked.append(len(executor.futures))
        # Waits twice.
        return asked.count(asked[-1]) > 2 and asked[-1] > 0

    settings = replace(DEFAULT, poll_interval=1e-3)
    plan = plan_grasps(
        HOME, BODY, NEEDS, executor=executor, should_stop=should_stop, settings=settings
    )
    assert not plan.complete
    assert plan.grasps == ()
    assert executor.futures
    assert all(future.cancelled() for future in executor.futures)


class Search:
    """A search in the background that ends when it is told to, or has a plan."""

    def __init__(self, *arguments):
        self.arguments = arguments
        self.stop = SimpleNamespace(requested=False)
        self.done = False
        self.waited = 0

    def result(self):
        return GraspPlan((SimpleNamespace(score=1.0),), True, None, 7, 2, 0.1)

    def wait(self):
        assert self.stop.requested
        self.waited += 1


@pytest.fixture
def searches(monkeypatch):
    """Return the searches and pools that a searcher makes."""
    made, pools = [], []

    def search(*arguments):
        made.append(Search(*arguments))
        return made[-1]

    def pool(workers):
        pools.append(SimpleNamespace(executor=len(pools), open=True))
        pools[-1].close = lambda own=pools[-1]: setattr(own, 'open', False)
        return pools[-1]

    monkeypatch.setattr(searchers, 'BackgroundSearch', search)
    monkeypatch.setattr(searchers, 'WorkerPool', pool)
    monkeypatch.setattr(searchers, 'plan_in_words', lambda plan: f'{len(plan.grasps)} grasp')
    return made, pools


def test_the_next_search_has_the_same_processes(searches):
    made, pools = searches
    searcher = Searcher(2)
    searcher.cancel()
    for number in range(2):
        searcher.begin(HOME, BODY, NEEDS, 0, 0.0)
        made[number].done = True
        answer = searcher.answer()
        assert (answer.outcome, answer.message) == (Outcome.FOUND, '1 grasp')
        assert made[number].arguments[4] == 0
    assert len(pools) == 1
    searcher.close()
    assert not pools[0].open


def test_who_closes_during_a_search_ends_it(searches):
    made, pools = searches
    searcher = Searcher(2)
    searcher.begin(HOME, BODY, NEEDS, 0, 0.0)
    searcher.close()
    assert (made[0].waited, pools[0].open) == (1, False)
    assert searcher.answer() is None
    searcher.begin(HOME, BODY, NEEDS, 0, 0.0)
    assert len(pools) == 2


def test_a_grip_that_hardly_presses_is_opened_at_once(monkeypatch):
    reached = approach(HOME, SEED)
    closing = replace(reached.closing, facing=None)
    there = press(reached.path[-1], closing, np.full(2, 0.01)).config
    held = plan_release(there, BODY, MEMBERS, 0.03)
    assert held.violation is None
    assert held.apart > 1
    monkeypatch.setattr(release, 'LEAST_FORCE', 1e3)
    loose = plan_release(there, BODY, MEMBERS, 0.03)
    assert loose.violation is None
    assert loose.apart == 1
    assert len(held.path) - len(loose.path) == held.apart


class AtOnce:
    """An executor that does what it is given at once."""

    def submit(self, run, *arguments):
        done = Future()
        done.set_result(run(*arguments))
        return done


def test_another_executor_finds_the_same(monkeypatch):
    violation = Violation('grip', 1.0, 2.0, 15.0)
    asked, costs = [], SimpleNamespace(evaluations=2, analyses=1, grip=None, violation=violation)

    def squeeze_candidate(candidate):
        asked.append(candidate)
        return costs

    monkeypatch.setattr(grasp_search, 'squeeze_candidate', squeeze_candidate)
    settings = replace(DEFAULT, max_rounds=2)
    alone, other = (
        plan_grasps(HOME, BODY, NEEDS, executor=executor, settings=settings)
        for executor in (None, AtOnce())
    )
    assert alone.complete
    assert other.complete
    assert (alone.evaluations, alone.analyses) == (other.evaluations, other.analyses)
    assert alone.analyses == other.analyses == len(asked) / 2 > 1
    assert other.closest_violation == violation
    costs.evaluations, costs.analyses = 7, 3
    more = plan_grasps(HOME, BODY, NEEDS, settings=settings)
    assert more.evaluations - alone.evaluations == alone.analyses * (7 + 3 - 2 - 1)
