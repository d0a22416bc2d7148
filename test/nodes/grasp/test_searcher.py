# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Searches in the background: how each ends, and how far it says that it is."""

from concurrent.futures.process import BrokenProcessPool
import time

from isotruss_ros import workers
from isotruss_ros.core import ConvexObject, GraspRequirements, load_robot
from isotruss_ros.core.errors import GraspError, SolverError, StructureError
from isotruss_ros.core.planning.grasp_plan import GraspPlan, Progress
from isotruss_ros.nodes.grasp.searcher import Searcher, SearchOutcome
import pytest

#: What is searched for; no search of these tests computes anything.
BODY = ConvexObject.disc((0.716, 0.43), 0.3)
SEARCH = load_robot('nine_member').home, BODY, GraspRequirements(), 0
DEADLINE = 240.0


def answer_of(searcher):
    deadline = time.monotonic() + DEADLINE
    while (answer := searcher.answer()) is None:
        assert time.monotonic() < deadline
    return answer


@pytest.mark.parametrize(
    ('error', 'outcome', 'words'),
    [
        (GraspError('no such module'), SearchOutcome.BAD_GOAL, 'no such module'),
        (StructureError('two laws'), SearchOutcome.FAILED, 'two laws'),
        (SolverError('no step'), SearchOutcome.FAILED, 'no step'),
        (ZeroDivisionError('an accident'), SearchOutcome.FAILED, 'ZeroDivisionError: an accident'),
        (BrokenProcessPool('gone'), SearchOutcome.FAILED, 'a process of the search died'),
    ],
)
def test_every_error_of_a_search_is_its_result(error, outcome, words):
    def plan(*_arguments, **_options):
        raise error

    searcher = Searcher(1, plan)
    assert searcher.answer() is None
    searcher.begin(*SEARCH, 0.0)
    answer = answer_of(searcher)
    assert (answer.outcome, answer.plan) == (outcome, None)
    assert words in answer.message
    assert searcher.answer() is None
    assert searcher.progress() is None
    searcher.close()


@pytest.mark.parametrize(
    ('estimate', 'limit', 'left'), [(10.0, 0.0, 10.0), (50.0, 20.0, 17.0), (None, 20.0, None)]
)
def test_the_time_left_is_no_longer_than_the_limit(estimate, limit, left, monkeypatch):
    now = 100.0
    # The clock of the machine.
    monkeypatch.setattr(workers.time, 'monotonic', lambda: now)

    def plan(config, body, needs, seed, executor, on_progress, stop, uncertainty):
        nonlocal now
        now += 3.0
        on_progress(Progress(5, 1, 2.0, 0.5, estimate))

    searcher = Searcher(1, plan)
    searcher.begin(*SEARCH, limit)
    while searcher.progress().evaluations == 0:
        pass
    result = searcher.progress()
    searcher.close()
    assert (result.evaluations, result.found, result.best, result.share) == (5, 1, 2.0, 0.5)
    assert result.time_left == (left if left is None else pytest.approx(left))


@pytest.mark.parametrize(
    ('complete', 'requested', 'outcome'),
    [
        (True, False, SearchOutcome.NONE_FOUND),
        (False, False, SearchOutcome.TIME_OUT),
        (False, True, SearchOutcome.CANCELLED),
    ],
)
def test_a_plan_without_grasps_has_its_reason(complete, requested, outcome):
    plan = GraspPlan((), complete, None, 7, 2, 0.1)
    searcher = Searcher(1, lambda *_, **__: plan)
    searcher.begin(*SEARCH, 0.0)
    assert searcher.progress() == Progress(0, 0, None, 0.0, None)
    if requested:
        searcher.cancel()
    answer = answer_of(searcher)
    assert (answer.outcome, answer.plan) == (outcome, plan)
    assert 'in 7 evaluations' in answer.message
    searcher.close()
