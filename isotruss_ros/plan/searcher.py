"""One search after the other, and the processes for them; what it came to is an answer."""

from __future__ import annotations

from concurrent.futures.process import BrokenProcessPool
import enum
import traceback
from typing import NamedTuple

from isotruss_ros.core import (
    Configuration,
    Cylinder,
    GraspError,
    GraspPlan,
    GraspRequirements,
    IsotrussError,
    Progress,
)
from isotruss_ros.plan.background import BackgroundSearch
from isotruss_ros.plan.pool import WorkerPool
from isotruss_ros.plan.words import plan_in_words


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

    :ivar message: in words.
    :ivar plan: what was found; None where there was no search, or it failed.
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
        cylinder: Cylinder,
        requirements: GraspRequirements,
        seed: int,
        time_limit: float,
    ) -> None:
        """Begin a search, while there is none; see `BackgroundSearch`."""
        if self._pool is None:
            self._pool = WorkerPool(self._workers)
        # One of its own: a configuration keeps what is computed of it, in one thread only.
        own = Configuration(config.robot, config.roller_positions, config.points)
        self._search = BackgroundSearch(
            own, cylinder, requirements, seed, self._pool.executor, time_limit
        )

    def progress(self) -> Progress | None:
        """Return how far the search is; None where there is none."""
        return None if self._search is None else self._search.progress()

    def cancel(self) -> None:
        """Let the search end soon, with what it has found."""
        if self._search is not None:
            self._search.stop.asked = True

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
        if search.stop.asked:
            outcome = Outcome.CANCELLED
        elif plan.grasps:
            outcome = Outcome.FOUND
        else:
            outcome = Outcome.NONE_FOUND if plan.complete else Outcome.TIME_OUT
        return Answer(outcome, plan_in_words(plan), plan)

    def close(self) -> None:
        """End the search, whose result is lost, and the processes."""
        if self._search is not None:
            self._search.stop.asked = True
            self._search.wait()
            self._search = None
        if self._pool is not None:
            self._pool.close()
            self._pool = None
