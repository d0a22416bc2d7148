# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""One search for grasps in a thread of its own, and what ends it."""

from __future__ import annotations

from concurrent.futures import Executor
import math
import threading
import time

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.planning.grasp_plan import GraspPlan, Progress
from isotruss_ros.core.planning.plan_grasps import plan_grasps
from isotruss_ros.core.planning.requirements import GraspRequirements


class Stop:
    """
    Whether a search stops: on request, or at its time limit.

    :ivar requested: whether it was requested.
    :param time_limit: from now [s]; none if 0.
    """

    def __init__(self, time_limit: float = 0.0) -> None:
        self._deadline = time.monotonic() + (time_limit or math.inf)
        self.requested = False

    @property
    def time_left(self) -> float:
        """Return the time until the limit [s]."""
        return max(0.0, self._deadline - time.monotonic())

    def __call__(self) -> bool:
        """Return whether to stop now; what `plan_grasps` asks."""
        return self.requested or self.time_left == 0.0


class BackgroundSearch:
    """
    One search; it begins at once.

    :ivar stop: set `stop.requested` to end it, with the plan until then.
    :param config: configuration of the robot.
    :param body: the object.
    :param requirements: what a grasp must fulfil.
    :param seed: of the search.
    :param executor: see `plan_grasps`.
    :param time_limit: [s]; none if 0.
    """

    def __init__(
        self,
        config: Configuration,
        body: ConvexObject,
        requirements: GraspRequirements,
        seed: int,
        executor: Executor,
        time_limit: float = 0.0,
    ) -> None:
        self.stop = Stop(time_limit)
        self._progress: tuple[Progress, float] | None = None
        self._plan: GraspPlan | None = None
        self._error: Exception | None = None
        arguments = (config, body, requirements, seed, executor)
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
        Wait for the end and return the plan.

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
        progress, when = self._progress
        if progress.time_left is None:
            return progress
        left = max(0.0, progress.time_left - (time.monotonic() - when))
        left = min(left, self.stop.time_left)
        return Progress(progress.evaluations, progress.found, progress.best, progress.share, left)

    def _run(
        self,
        config: Configuration,
        body: ConvexObject,
        requirements: GraspRequirements,
        seed: int,
        executor: Executor,
    ) -> None:
        try:
            self._plan = plan_grasps(
                config, body, requirements, seed, executor, self._take, self.stop
            )
        except Exception as error:  # noqa: BLE001 - it is raised where the result is requested for
            self._error = error

    def _take(self, progress: Progress) -> None:
        self._progress = progress, time.monotonic()
