"""A search for grasps in a thread of its own, for those who must stay answerable meanwhile."""

from __future__ import annotations

from concurrent.futures import Executor
import math
import threading
import time

from isotruss_ros.core import (
    Configuration,
    Cylinder,
    GraspPlan,
    GraspRequirements,
    plan_grasps,
    Progress,
)


class Stop:
    """
    When a search is to stop: when it is told to, or when its time is up.

    :ivar asked: whether it was told to.
    :param time_limit: from now [s]; none if 0.
    """

    def __init__(self, time_limit: float = 0.0) -> None:
        self._deadline = time.monotonic() + (time_limit or math.inf)
        self.asked = False

    @property
    def time_left(self) -> float:
        """Return the time until the limit [s]."""
        return max(0.0, self._deadline - time.monotonic())

    def __call__(self) -> bool:
        """Return whether to stop now; what `plan_grasps` asks."""
        return self.asked or self.time_left == 0.0


class BackgroundSearch:
    """
    One search; it begins at once.

    :ivar stop: set `stop.asked` to end it, with what was found until then.
    :param executor: see `plan_grasps`.
    :param time_limit: [s]; none if 0.
    """

    def __init__(
        self,
        config: Configuration,
        cylinder: Cylinder,
        requirements: GraspRequirements,
        seed: int,
        executor: Executor,
        time_limit: float = 0.0,
    ) -> None:
        self.stop = Stop(time_limit)
        self._progress: tuple[Progress, float] | None = None
        self._plan: GraspPlan | None = None
        self._error: Exception | None = None
        arguments = (config, cylinder, requirements, seed, executor)
        self._thread = threading.Thread(target=self._run, args=arguments, daemon=True)
        self._thread.start()

    @property
    def done(self) -> bool:
        """Return whether there is a result."""
        return not self._thread.is_alive()

    def wait(self) -> None:
        """Wait for the end, whatever it is."""
        self._thread.join()

    def result(self) -> GraspPlan:
        """
        Wait for the end and return what was found.

        :raises Exception: whatever ended the search.
        """
        self.wait()
        if self._error is not None:
            raise self._error
        return self._plan

    def progress(self) -> Progress:
        """Return how far the search is, and how long it may still take from now on."""
        if self._progress is None:
            return Progress(0, 0, None, 0.0, None)
        told, when = self._progress
        if told.time_left is None:
            return told
        left = max(0.0, told.time_left - (time.monotonic() - when))
        left = min(left, self.stop.time_left)
        return Progress(told.evaluations, told.found, told.best, told.share, left)

    def _run(
        self,
        config: Configuration,
        cylinder: Cylinder,
        requirements: GraspRequirements,
        seed: int,
        executor: Executor,
    ) -> None:
        try:
            self._plan = plan_grasps(
                config, cylinder, requirements, seed, executor, self._take, self.stop
            )
        except Exception as error:  # noqa: BLE001 - it is raised where the result is asked for
            self._error = error

    def _take(self, progress: Progress) -> None:
        self._progress = progress, time.monotonic()
