# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What a search for grasps has found so far, and how it goes on."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, wait
from dataclasses import replace
import time

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.planning.closing import Closing, mean_member_length
from isotruss_ros.core.planning.grasp_candidate import (
    judge_candidate,
    Judged,
    make_grasp_candidate,
)
from isotruss_ros.core.planning.grasp_plan import GraspPlan, PlannedGrasp, Progress, SearchTally
from isotruss_ros.core.planning.requirements import GraspRequirements
from isotruss_ros.core.planning.settings import SearchSettings
import numpy as np


class GraspSearch:
    """
    What a search has found so far.

    :ivar stopped: whether it was stopped.
    :ivar tally: what it has looked at.
    :param config: configuration of the robot.
    :param needs: what a grasp must fulfil.
    :param on_progress: see `plan_grasps`.
    :param should_stop: see `plan_grasps`.
    :param settings: of the search.
    """

    def __init__(
        self,
        config: Configuration,
        needs: GraspRequirements,
        on_progress: Callable[[Progress], None],
        should_stop: Callable[[], bool],
        settings: SearchSettings,
    ) -> None:
        self._settings, self._config, self._needs = settings, config, needs
        self._on_progress, self._should_stop = on_progress, should_stop
        self._began = time.perf_counter()
        self._grasps: list[PlannedGrasp] = []
        self._judged = self._known = 0
        self.stopped, self.tally = False, SearchTally()

    def judge(
        self, closings: Sequence[Closing], executor: Executor | None, thorough: bool
    ) -> None:
        """
        Compute the grasps of some seeds.

        :param closings: the seeds.
        :param executor: where they are computed; in this process if None.
        :param thorough: whether all are, or only until there are enough grasps.
        """
        self._known += len(closings)
        self._on_progress(self._progress())
        for grasp, tally in self._judge_each(closings, executor):
            self._judged += 1
            self.tally.add(tally)
            if grasp is not None:
                # Of the caller's robot, not of another process's.
                points, robot = grasp.config.points, self._config.robot
                config = Configuration(robot, grasp.roller_positions, points)
                self._grasps.append(replace(grasp, config=config))
            self._on_progress(self._progress())
            if not thorough and len(self.best()) >= self._needs.count:
                return

    def best(self) -> list[PlannedGrasp]:
        """Return the distinct grasps, best first."""
        same = self._settings.same_share * mean_member_length(self._config)
        distinct: list[PlannedGrasp] = []
        for grasp in sorted(self._grasps, key=lambda grasp: -grasp.score):
            if not any(
                grasp.members == other.members
                and np.abs(grasp.path[-1] - other.path[-1]).max() < same
                for other in distinct
            ):
                distinct.append(grasp)
        return distinct[: self._needs.count]

    def plan(self) -> GraspPlan:
        """Return the plan."""
        best, tally = tuple(self.best()), self.tally
        return GraspPlan(
            best,
            not self.stopped,
            None if best else tally.closest,
            tally.evaluations + tally.analyses,
            tally.analyses,
            time.perf_counter() - self._began,
        )

    def _judge_each(
        self, closings: Sequence[Closing], executor: Executor | None
    ) -> Iterator[Judged]:
        """Yield what becomes of seeds, in their order, until it is to stop."""
        candidates = [make_grasp_candidate(self._config, each, self._needs) for each in closings]
        if executor is None:
            for candidate in candidates:
                if self._check_stop():
                    return
                yield judge_candidate(candidate, self._check_stop)
            return
        futures = [executor.submit(judge_candidate, candidate) for candidate in candidates]
        try:
            for future in futures:
                while not wait([future], self._settings.poll_interval).done:
                    if self._check_stop():
                        return
                yield future.result()
        finally:
            for future in futures:
                future.cancel()

    def _progress(self) -> Progress:
        """Return the progress of the search."""
        share = self._judged / self._known if self._known else 0.0
        spent = time.perf_counter() - self._began
        best = max((grasp.score for grasp in self._grasps), default=None)
        left = spent * (1.0 / share - 1.0) if share else None
        evaluations = self.tally.evaluations + self.tally.analyses
        return Progress(evaluations, len(self.best()), best, share, left)

    def _check_stop(self) -> bool:
        self.stopped = self.stopped or self._should_stop()
        return self.stopped
