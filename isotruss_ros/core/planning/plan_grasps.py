# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The search for grasps: first where the grip must be, then the indentations of its members.

Each round has a number of seeds: a module, its opening, the grasping members, and the nominal
posture that the remaining freedom is drawn to. Kinematics brings every seed to an open grip, or
shows that there is none; statics finds the indentations, shortest path first. The first round
has the seeds that are usually good; the others have random postures.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, wait
from dataclasses import replace
import time

from isotruss_ros.core.errors import ConfigurationError, GraspError, SolverError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grasp import Grasp
from isotruss_ros.core.manipulation.grip import find_members, Grip, members_at
from isotruss_ros.core.model.convex_object import as_convex_object, ConvexObject
from isotruss_ros.core.model.objects import Cylinder
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.planning.approach import Approach, approach
from isotruss_ros.core.planning.closing_qp import Closing
from isotruss_ros.core.planning.grasp_candidate import (
    make_grasp_candidate,
    squeeze_candidate,
    Squeezed,
)
from isotruss_ros.core.planning.grasp_plan import GraspPlan, PlannedGrasp, Progress, Violation
from isotruss_ros.core.planning.grip_seeds import count_seen, find_grip_seeds
from isotruss_ros.core.planning.requirements import GraspRequirements, rate_grasp
from isotruss_ros.core.planning.seeds import find_seeds
from isotruss_ros.core.planning.settings import DEFAULT, SearchSettings
from isotruss_ros.core.safety.distances import object_gaps
from isotruss_ros.core.safety.margins import shape_margins
from isotruss_ros.core.statics.structure import structure_of
import numpy as np

#: An object that overlaps the robot by less than this does not yet touch it [m].
OVERLAP = 1e-6


@single_threaded
def plan_grasps(
    config: Configuration,
    body: Cylinder | ConvexObject,
    requirements: GraspRequirements | None = None,
    seed: int = 0,
    executor: Executor | None = None,
    on_progress: Callable[[Progress], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
    thorough: bool = True,
    settings: SearchSettings = DEFAULT,
) -> GraspPlan:
    """
    Find grasps of a free object inside a loop of the robot, and the paths to them.

    A cylinder is grasped by the two members that meet at a module. Of a `ConvexObject` grips are
    tried of any two members and any three around it, whatever tubes these are of; they are ranked
    by slip margin, unless another measure is asked for. Where the requirements name members, a
    cylinder is such an object too.

    The same seed gives the same plan on any number of cores: candidates are evaluated in their
    order, wherever they are computed.

    :param config: configuration of the robot.
    :param body: the object; a friction coefficient of its own counts in place of the required one.
    :param requirements: what a grasp must fulfil; those of `GraspRequirements()` if None.
    :param seed: of the random postures.
    :param executor: where candidates are computed: a process pool, or that of a Dask client; in
        this process if None.
    :param on_progress: called when the open grips of a round are known, and after every candidate.
    :param should_stop: called before every step toward an open grip, after every candidate and,
        with an executor, at the poll interval; a plan that was stopped has the grasps so far.
    :param thorough: whether all candidates of a round are computed before the best are chosen,
        or only until there are enough grasps.
    :param settings: of the search.
    :raises GraspError: the robot has no such module or members, or the seed is not usable.
    :raises StructureError: the robot cannot be analysed.
    """
    needs = requirements or GraspRequirements()
    if needs.members is not None:
        find_members(config.robot, needs.members)  # names are checked here, once
        body = as_convex_object(body)
    if isinstance(body, ConvexObject) and body.friction is not None:
        needs = replace(needs, friction=body.friction)
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or seed < 0:
        raise GraspError(f'seed {seed!r}: must be an integer, not negative')
    search = _Search(config, body, needs, on_progress or _ignore, should_stop or _never, settings)
    structure_of(config)  # contradictory stiffness laws are reported here, once
    for number in range(settings.max_rounds if search.is_free() else 0):
        if isinstance(body, ConvexObject):
            seeds = find_grip_seeds(config, body, needs, int(seed), number, settings)
        else:
            seeds = find_seeds(config, body, needs, int(seed), number, settings)
        opened = search.approach(seeds)
        for reached, squeezed in search.squeeze(opened, executor):
            search.add(reached, squeezed)
            if not thorough and len(search.best()) >= needs.count:
                break
        if search.stopped or len(search.best()) >= needs.count:
            break
    return search.plan()


class _Search:
    """The state of one search."""

    def __init__(
        self,
        config: Configuration,
        body: Cylinder | ConvexObject,
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
        gaps = object_gaps(self._config, self._body)
        least = float(min(gaps.members.min(), gaps.modules.min(), gaps.rods.min()))
        free = least >= -OVERLAP
        if not free:
            self._record(Violation('free', least, 0.0, 2000.0))
        return free

    def approach(self, closings: Sequence[Closing]) -> list[Approach]:
        """Bring the seeds of a round to open grips; return these."""
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
            self._record(self._explain_no_seeds())
        self._known += len(opened)
        self._on_progress(self.progress())
        return sorted(opened, key=lambda reached: reached.travel)

    def squeeze(
        self, opened: Sequence[Approach], executor: Executor | None
    ) -> Iterator[tuple[Approach, Squeezed]]:
        """Compute the grasps of open grips; yield them in their order."""
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
        """Add the result of a candidate."""
        self._judged += 1
        self._evaluations += squeezed.evaluations + squeezed.analysed
        self._analyses += squeezed.analysed
        if squeezed.violation is not None:
            self._record(squeezed.violation)
        else:
            self._grasps.append(self._planned(reached, squeezed))
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

    def _planned(self, reached: Approach, squeezed: Squeezed) -> PlannedGrasp:
        robot, closing = self._config.robot, reached.closing
        opened = np.array([config.roller_positions for config in reached.path])
        path = np.concatenate([opened, squeezed.positions])
        travel = float(np.abs(np.diff(path, axis=0)).sum(axis=0).max())
        rigid = min(shape_margins(config).rigidity for config in reached.path)
        analysis, body = squeezed.analysis, squeezed.body
        grasp = None
        if isinstance(body, Cylinder):
            assert closing.module is not None
            grasp = Grasp(robot.module_names[closing.module], body.center, body.diameter)
        names = tuple(robot.member_names[i] for i in closing.members)
        return PlannedGrasp(
            grasp=grasp,
            grip=Grip(names, body, self._needs.friction),
            members=tuple(analysis.contact_lengths),
            config=Configuration(robot, path[-1], squeezed.points),
            analysis=analysis,
            score=rate_grasp(
                self._needs,
                analysis,
                squeezed.loads.max_total_force,
                squeezed.slip_margin,
                -travel,
            ),
            squeeze=squeezed.squeeze,
            slip_margin=squeezed.slip_margin,
            closure_margin=analysis.closure_margin,
            required_friction=analysis.required_friction,
            max_contact_force=squeezed.loads.max_contact_force,
            total_force=squeezed.loads.max_total_force,
            utilisation=squeezed.loads.max_utilisation,
            travel=travel,
            rigidity=min(rigid, squeezed.rigidity),
            path=path,
            touch=len(opened),
        )

    def _explain_no_seeds(self) -> Violation:
        """Return why there is not even a seed: no members around the object, or not those."""
        wanted, body = self._needs.members, self._body
        if self._needs.module is not None and isinstance(body, ConvexObject):
            wanted = members_at(self._config.robot, self._needs.module)
        if wanted is not None:
            seen, around = count_seen(self._config, as_convex_object(body).middle, wanted)
            if around:
                name = 'members' if seen < len(wanted) else 'opposed'
                return Violation(name, float(seen), float(len(wanted)), 1000.0)
        return Violation('enclosed', 0.0, 1.0, 1000.0)

    def _check_stop(self) -> bool:
        self.stopped = self.stopped or self._should_stop()
        return self.stopped

    def _record(self, violation: Violation) -> None:
        if self._closest is None or violation.distance < self._closest.distance:
            self._closest = violation


def _ignore(_progress: Progress) -> None:
    pass


def _never() -> bool:
    return False
