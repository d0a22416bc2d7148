# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Searches for grasps in a background thread, with a pool of worker processes."""

from __future__ import annotations

from concurrent.futures.process import BrokenProcessPool
import enum
import traceback
from typing import NamedTuple

from isotruss_ros.core.errors import GraspError, IsotrussError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.planning.background_search import BackgroundSearch
from isotruss_ros.core.planning.grasp_plan import GraspPlan, Progress
from isotruss_ros.core.planning.plan_words import plan_in_words
from isotruss_ros.core.planning.requirements import GraspRequirements
from isotruss_ros.core.planning.workers import WorkerPool


class Outcome(enum.IntEnum):
    """Why a search ended; numbers as in the action PlanGrasp."""

    FOUND = 0
    NONE_FOUND = 1
    TIME_OUT = 2
    CANCELLED = 3
    BAD_GOAL = 4
    NO_JOINT_STATES = 5
    FAILED = 6


class Answer(NamedTuple):
    """
    What a search came to.

    :ivar outcome: why the search ended.
    :ivar message: in words.
    :ivar plan: the plan; None where there was no search, or it failed.
    """

    outcome: Outcome
    message: str
    plan: GraspPlan | None = None


class Searcher:
    """
    Searches without keeping the caller waiting; the processes are made at the first search.

    :param workers: see `WorkerPool`.
    """

    def __init__(self, workers: int) -> None:
        self._workers = workers
        self._pool: WorkerPool | None = None
        self._search: BackgroundSearch | None = None

    def begin(
        self,
        config: Configuration,
        body: ConvexObject,
        requirements: GraspRequirements,
        seed: int,
        time_limit: float,
    ) -> None:
        """
        Begin a search, while there is none; see `BackgroundSearch`.

        :param config: configuration of the robot.
        :param body: the object.
        :param requirements: what a grasp must fulfil.
        :param seed: of the search.
        :param time_limit: of the search [s]; none if 0.
        """
        if self._pool is None:
            self._pool = WorkerPool(self._workers)
        # One of its own: a configuration keeps what is computed of it, in one thread only.
        own = Configuration(config.robot, config.roller_positions, config.points)
        self._search = BackgroundSearch(
            own, body, requirements, seed, self._pool.executor, time_limit
        )

    def progress(self) -> Progress | None:
        """Return how far the search is; None where there is none."""
        return None if self._search is None else self._search.progress()

    def cancel(self) -> None:
        """Let the search end soon, with what it has found."""
        if self._search is not None:
            self._search.stop.requested = True

    def answer(self) -> Answer | None:
        """Return what the search came to, once; None while it goes on or there is none."""
        if self._search is None or not self._search.done:
            return None
        search, self._search = self._search, None
        try:
            plan = search.result()
        except GraspError as error:
            return Answer(Outcome.BAD_GOAL, str(error))
        except IsotrussError as error:
            return Answer(Outcome.FAILED, str(error))
        except BrokenProcessPool:
            self.close()
            reason = 'a process of the search died; the next search has new ones'
            return Answer(Outcome.FAILED, reason)
        except Exception as error:  # noqa: BLE001 - whatever it is, the next search must work
            traceback.print_exception(error)
            self.close()
            return Answer(Outcome.FAILED, f'{type(error).__name__}: {error}')
        if search.stop.requested:
            outcome = Outcome.CANCELLED
        elif plan.grasps:
            outcome = Outcome.FOUND
        else:
            outcome = Outcome.NONE_FOUND if plan.complete else Outcome.TIME_OUT
        return Answer(outcome, plan_in_words(plan), plan)

    def close(self) -> None:
        """End the search, whose result is lost, and the processes."""
        if self._search is not None:
            self._search.stop.requested = True
            self._search.wait()
            self._search = None
        if self._pool is not None:
            self._pool.close()
            self._pool = None
