# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Search for grasps in a background thread, with a pool of worker processes."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
import enum
import functools
import threading
import traceback
from typing import NamedTuple

from isotruss_ros.core.chance.uncertainty import Uncertainty
from isotruss_ros.core.errors import GraspError, IsotrussError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.planning.grasp_plan import GraspPlan, plan_in_words, Progress
from isotruss_ros.core.planning.plan_grasps import plan_grasps
from isotruss_ros.core.planning.requirements import GraspRequirements
from isotruss_ros.workers import Stop, WorkerPool


class SearchOutcome(enum.IntEnum):
    """Codes for the outcome of a search, equal to those of the action PlanGrasp."""

    FOUND = 0
    NONE_FOUND = 1
    TIME_OUT = 2
    CANCELLED = 3
    BAD_GOAL = 4
    NO_JOINT_STATES = 5
    FAILED = 6


class Answer(NamedTuple):
    """Result of a grasp search in the background."""

    outcome: SearchOutcome  #: code of the outcome
    message: str  #: sentence with the result
    plan: GraspPlan | None = None  #: the plan; None without a search, or after a failure


class Searcher:
    """
    Search for grasps in the background; its worker processes start with the first search.

    :param plan: function that searches, with the arguments of `plan_grasps`.
    """

    def __init__(self, workers: int, plan: Callable[..., GraspPlan] = plan_grasps) -> None:
        self._workers, self._pool, self._plan = workers, WorkerPool(workers), plan
        self._search: Future[GraspPlan] | None = None
        self._stop = Stop()

    def begin(
        self,
        config: Configuration,
        body: ConvexObject,
        requirements: GraspRequirements,
        seed: int,
        time_limit: float = 0.0,
        uncertainty: Uncertainty | None = None,
    ) -> None:
        """Start a search for grasps; no other search may be running."""
        self._search, self._stop = Future(), Stop(time_limit)
        self._progress = Progress(0, 0, None, 0.0, None)
        search = functools.partial(
            self._plan,
            config,
            body,
            requirements,
            seed,
            self._pool.executor,
            self._take,
            self._stop,
            uncertainty=uncertainty,
        )
        threading.Thread(target=_run, args=(search, self._search), daemon=True).start()

    def progress(self) -> Progress | None:
        """Return progress and remaining time of the running search; None if none is running."""
        return None if self._search is None else self._progress

    def cancel(self) -> None:
        """Ask the search to stop; its result contains the grasps found so far."""
        self._stop.requested = True

    def answer(self) -> Answer | None:
        """Return the result of a finished search once, then discard it; None without a result."""
        if self._search is None or not self._search.done():
            return None
        search, self._search = self._search, None
        try:
            plan = search.result()
        except GraspError as error:
            return Answer(SearchOutcome.BAD_GOAL, str(error))
        except IsotrussError as error:
            return Answer(SearchOutcome.FAILED, str(error))
        except BrokenProcessPool:
            self.close()
            reason = 'a process of the search died; the next search has new ones'
            return Answer(SearchOutcome.FAILED, reason)
        except Exception as error:  # noqa: BLE001 - the next search must work
            traceback.print_exception(error)
            self.close()
            return Answer(SearchOutcome.FAILED, f'{type(error).__name__}: {error}')
        if self._stop.requested:
            outcome = SearchOutcome.CANCELLED
        elif plan.grasps:
            outcome = SearchOutcome.FOUND
        else:
            outcome = SearchOutcome.NONE_FOUND if plan.complete else SearchOutcome.TIME_OUT
        return Answer(outcome, plan_in_words(plan), plan)

    def close(self) -> None:
        """Stop the search without a result, and end its worker processes."""
        if self._search is not None:
            self.cancel()
            self._search.exception()  # joins the thread
            self._search = None
        self._pool.close()
        self._pool = WorkerPool(self._workers)  # without started processes

    def _take(self, progress: Progress) -> None:
        if progress.time_left is not None:
            time_left = min(progress.time_left, self._stop.time_left)
            progress = replace(progress, time_left=time_left)
        self._progress = progress


def _run(search: Callable[[], GraspPlan], result: Future[GraspPlan]) -> None:
    try:
        result.set_result(search())
    except Exception as error:  # noqa: BLE001 - it is raised where the result is asked for
        result.set_exception(error)
