# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""One search for grasps: what was found, and how far it is."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, wait
import time

from isotruss_ros.core.errors import ConfigurationError, GraspError, SolverError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.planning.approach import Approach, approach
from isotruss_ros.core.planning.closed_grip import ClosedGrip
from isotruss_ros.core.planning.closing import Closing
from isotruss_ros.core.planning.foresee_path import foresee_grip
from isotruss_ros.core.planning.grasp_candidate import (
    make_grasp_candidate,
    squeeze_candidate,
    Squeezed,
)
from isotruss_ros.core.planning.grasp_plan import (
    closer_violation,
    GraspPlan,
    PlannedGrasp,
    Progress,
    Violation,
)
from isotruss_ros.core.planning.requirements import GraspRequirements, rate_grasp
from isotruss_ros.core.planning.seeds import explain_no_seeds
from isotruss_ros.core.planning.settings import SearchSettings
from isotruss_ros.core.safety.margins import object_distances, shape_margins
import numpy as np

#: An object that overlaps the robot by less than this does not yet touch it [m].
OVERLAP = 1e-6


class GraspSearch:
    """
    What a search has found so far.

    :ivar stopped: whether it was stopped.
    :param config: configuration of the robot.
    :param body: the object.
    :param needs: what a grasp must fulfil.
    :param on_progress: see `plan_grasps`.
    :param should_stop: see `plan_grasps`.
    :param settings: of the search.
    """

    def __init__(
        self,
        config: Configuration,
        body: ConvexObject,
        needs: GraspRequirements,
        on_progress: Callable[[Progress], None],
        should_stop: Callable[[], bool],
        settings: SearchSettings,
    ) -> None:
        self._settings = settings
        self._config, self._body, self._needs = config, body, needs
        self._on_progress, self._should_stop = on_progress, should_stop
        self._began = time.perf_counter()
        self._grasps: list[PlannedGrasp] = []
        self._closest: Violation | None = None
        self._evaluations = self._analyses = self._judged = self._known = 0
        self.stopped = False

    def is_free(self) -> bool:
        """Return whether nothing touches the object yet; otherwise there is no path to a grasp."""
        least = float(object_distances(self._config, self._body).min())
        free = least >= -OVERLAP
        if not free:
            self._record(Violation('free', least, 0.0, 2000.0))
        return free

    def approach(self, closings: Sequence[Closing]) -> list[Approach]:
        """
        Bring the seeds of a round to open grips; return these, the shortest path first.

        :param closings: the seeds.
        """
        opened = []
        for closing in closings:
            if self._check_stop():
                break
            try:
                reached = approach(self._config, closing, self._check_stop)
            except (ConfigurationError, SolverError) as error:
                # A seed that cannot be computed is skipped.
                self._record(Violation(str(error), 0.0, 0.0, 100.0))
                continue
            self._evaluations += reached.evaluations
            if reached.unmet is None:
                opened.append(reached)
                continue
            name, value = reached.unmet
            self._record(Violation(name, float(value), closing.bound(name), 100.0))
        if not closings:
            self._record(explain_no_seeds(self._config, self._body, self._needs))
        self._known += len(opened)
        self._on_progress(self.progress())
        return sorted(opened, key=lambda reached: reached.travel)

    def squeeze(
        self, opened: Sequence[Approach], executor: Executor | None
    ) -> Iterator[tuple[Approach, Squeezed]]:
        """
        Compute the grasps of open grips; yield them in their order.

        :param opened: the open grips.
        :param executor: where they are computed; in this process if None.
        """
        candidates = [make_grasp_candidate(reached, self._needs) for reached in opened]
        if executor is None:
            for reached, candidate in zip(opened, candidates, strict=True):
                if self._check_stop():
                    return
                yield reached, squeeze_candidate(candidate)
            return
        futures = [executor.submit(squeeze_candidate, candidate) for candidate in candidates]
        try:
            for reached, future in zip(opened, futures, strict=True):
                while not wait([future], self._settings.poll_interval).done:
                    if self._check_stop():
                        return
                yield reached, future.result()
        finally:
            for future in futures:
                future.cancel()

    def add(self, reached: Approach, squeezed: Squeezed) -> None:
        """
        Add the result of a candidate.

        :param reached: the open grip.
        :param squeezed: what became of it.
        """
        self._judged += 1
        self._evaluations += squeezed.evaluations + squeezed.analyses
        self._analyses += squeezed.analyses
        violation = squeezed.violation
        if squeezed.grip is not None:
            grasp = self._planned(reached, squeezed.grip)
            violation = self._carry(grasp) if self._needs.carry else None
        if violation is None:
            self._grasps.append(grasp)
        else:
            self._record(violation)
        self._on_progress(self.progress())

    def best(self) -> list[PlannedGrasp]:
        """Return the distinct grasps, best first."""
        same = self._settings.same_share * float(self._config.robot.home.member_lengths.mean())
        distinct: list[PlannedGrasp] = []
        for grasp in sorted(self._grasps, key=lambda grasp: -grasp.score):
            if not any(
                grasp.members == other.members
                and np.abs(grasp.path[-1] - other.path[-1]).max() < same
                for other in distinct
            ):
                distinct.append(grasp)
        return distinct[: self._needs.count]

    def progress(self) -> Progress:
        """Return the progress of the search."""
        share = self._judged / self._known if self._known else 0.0
        spent = time.perf_counter() - self._began
        best = max((grasp.score for grasp in self._grasps), default=None)
        left = spent * (1.0 / share - 1.0) if share else None
        return Progress(self._evaluations, len(self.best()), best, share, left)

    def plan(self) -> GraspPlan:
        """Return the plan."""
        best = tuple(self.best())
        return GraspPlan(
            best,
            not self.stopped,
            None if best else self._closest,
            self._evaluations,
            self._analyses,
            time.perf_counter() - self._began,
        )

    def _planned(self, reached: Approach, closed: ClosedGrip) -> PlannedGrasp:
        robot, needs = self._config.robot, self._needs
        analysis, loads = closed.analysis, closed.loads
        opened = np.array([config.roller_positions for config in reached.path])
        path = np.concatenate([opened, closed.path])
        travel = float(np.abs(np.diff(path, axis=0)).sum(axis=0).max())
        rigid = min(shape_margins(config).rigidity for config in reached.path)
        names = tuple(robot.member_names[i] for i in reached.closing.members)
        return PlannedGrasp(
            grip=Grip(names, closed.body, needs.friction),
            members=tuple(analysis.contact_lengths),
            config=Configuration(robot, path[-1], closed.points),
            analysis=analysis,
            score=rate_grasp(needs, analysis, loads.max_total_force, closed.slip_margin, -travel),
            squeeze=closed.squeeze,
            slip_margin=closed.slip_margin,
            closure_margin=analysis.closure_margin,
            required_friction=analysis.required_friction,
            max_contact_force=loads.max_contact_force,
            total_force=loads.max_total_force,
            utilisation=loads.max_utilisation,
            travel=travel,
            rigidity=min(rigid, closed.rigidity),
            path=path,
            touch=len(opened),
        )

    def _carry(self, grasp: PlannedGrasp) -> Violation | None:
        """Return how far a grasp does not carry the object along its path; None if it does."""
        friction, poses = self._needs.friction, np.array(self._needs.carry)
        try:
            found = foresee_grip(grasp.config, grasp.grip.body, friction, poses)
        except (ConfigurationError, GraspError, SolverError) as error:
            return Violation(str(error), 0.0, 1.0, 1.0)
        share = 0.0 if found is None else found.share
        return Violation('carry', share, 1.0, 1.0 - share) if found is None or found.why else None

    def _check_stop(self) -> bool:
        self.stopped = self.stopped or self._should_stop()
        return self.stopped

    def _record(self, violation: Violation) -> None:
        self._closest = closer_violation(self._closest, violation)
