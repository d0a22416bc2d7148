# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The search for grasps: first where the grip must be, then the indentations of its members.

Each round has a number of seeds: the grasping members, the directions in which they are to face
the object, and the nominal posture that the remaining freedom is drawn to. Kinematics brings every
seed to an open grip, or shows that there is none; statics closes it. The first round has the seeds
that are usually good; the others have random postures.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor, wait
from dataclasses import replace
import time

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.planning.closing import Closing
from isotruss_ros.core.planning.grasp_candidate import judge_candidate
from isotruss_ros.core.planning.grasp_plan import GraspPlan, PlannedGrasp, Progress
from isotruss_ros.core.planning.requirements import GraspRequirements
from isotruss_ros.core.planning.seeds import find_seeds, required_members
from isotruss_ros.core.planning.violations import SearchTally, Violation
from isotruss_ros.core.safety.margins import object_distances
from isotruss_ros.core.statics.structure import structure_of
import numpy as np

#: An object that overlaps the robot by less than this does not yet touch it [m].
OVERLAP = 1e-6
#: Grasps of the same members are the same where no roller differs by more than this, in mean
#: lengths of members at home.
SAME_SHARE = 0.02
#: How often a request to stop is checked while an executor computes [s].
POLL_INTERVAL = 0.05


@single_threaded
def plan_grasps(
    config: Configuration,
    body: ConvexObject,
    requirements: GraspRequirements | None = None,
    seed: int = 0,
    executor: Executor | None = None,
    on_progress: Callable[[Progress], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
    thorough: bool = True,
    max_rounds: int = 5,
) -> GraspPlan:
    """
    Find grasps of a free object inside a loop of the robot, and the paths to them.

    Grips are tried of any two members and any three around it, whatever tubes these are of, unless
    the requirements name a module or members; they are ranked by slip margin, unless another
    measure is asked for.

    The same seed gives the same plan on any number of cores: candidates are evaluated in their
    order, wherever they are computed.

    :param config: configuration of the robot.
    :param body: the object; a friction coefficient of its own counts in place of the required one.
    :param requirements: what a grasp must fulfil; those of `GraspRequirements()` if None.
    :param seed: of the random postures.
    :param executor: where candidates are computed: a process pool, or that of a Dask client; in
        this process if None.
    :param on_progress: called when the seeds of a round are known, and after every candidate.
    :param should_stop: called before every candidate, with an executor every `POLL_INTERVAL`; a
        plan that was stopped has the grasps so far.
    :param thorough: whether all candidates of a round are computed before the best are chosen,
        or only until there are enough grasps.
    :param max_rounds: of candidates, until there are enough grasps; all but the first are random.
    :raises GraspError: the robot has no such module or members, or the seed is not usable.
    :raises StructureError: the robot cannot be analysed.
    """
    needs = requirements or GraspRequirements()
    required_members(config.robot, needs)  # names are checked here, once
    if body.friction is not None:
        needs = replace(needs, friction=body.friction)
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or seed < 0:
        raise GraspError(f'seed {seed!r}: must be an integer, not negative')
    # As another process has it: nothing is known of it but the shape.
    config = Configuration(config.robot, config.roller_positions, config.points)
    structure_of(config)  # contradictory stiffness laws are reported here, once
    search = _Search(config, needs, executor, on_progress, should_stop)
    gap = float(object_distances(config, body).min())
    if gap < -OVERLAP:  # there is no path to a grasp
        search.tally.record(Violation('free', gap, 0.0))
        return search.plan()
    for number in range(max_rounds):
        with search.tally.recording():
            search.judge(find_seeds(config, body, needs, int(seed), number), thorough)
        if search.stopped or len(search.best()) >= needs.count:
            break
    return search.plan()


class _Search:
    """What a search has found so far; its parameters are those of `plan_grasps`."""

    def __init__(
        self,
        config: Configuration,
        needs: GraspRequirements,
        executor: Executor | None,
        on_progress: Callable[[Progress], None] | None,
        should_stop: Callable[[], bool] | None,
    ) -> None:
        self._config, self._needs, self._executor = config, needs, executor
        self._on_progress, self._should_stop = on_progress, should_stop
        self._began = time.perf_counter()
        self._grasps: list[PlannedGrasp] = []
        self._judged = self._known = 0
        self.stopped, self.tally = False, SearchTally()

    def judge(self, closings: list[Closing], thorough: bool) -> None:
        """Compute the grasps of seeds: of all, or only until there are enough."""
        self._known += len(closings)
        self._report()
        for grasp, tally in self._judge_each(closings):
            self._judged += 1
            self.tally.add(tally)
            if grasp is not None:
                # Of the caller's robot, not of another process's.
                points, robot = grasp.config.points, self._config.robot
                config = Configuration(robot, grasp.roller_positions, points)
                self._grasps.append(replace(grasp, config=config))
            self._report()
            if not thorough and len(self.best()) >= self._needs.count:
                return

    def best(self) -> list[PlannedGrasp]:
        """Return the distinct grasps, best first."""
        same = SAME_SHARE * self._config.robot.home.member_lengths.mean()
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
        self, closings: list[Closing]
    ) -> Iterator[tuple[PlannedGrasp | None, SearchTally]]:
        """Yield what becomes of seeds, in their order, until it is to stop."""
        if self._executor is None:
            for closing in closings:
                if self._check_stop():
                    return
                yield judge_candidate(self._config, closing, self._needs)
            return
        futures = [
            self._executor.submit(judge_candidate, self._config, closing, self._needs)
            for closing in closings
        ]
        try:
            for future in futures:
                while not wait([future], POLL_INTERVAL).done:
                    if self._check_stop():
                        return
                yield future.result()
        finally:
            for future in futures:
                future.cancel()

    def _report(self) -> None:
        """Tell how far the search is."""
        if self._on_progress is None:
            return
        share = self._judged / self._known if self._known else 0.0
        spent = time.perf_counter() - self._began
        self._on_progress(
            Progress(
                self.tally.evaluations + self.tally.analyses,
                len(self.best()),
                max((grasp.score for grasp in self._grasps), default=None),
                share,
                spent * (1.0 / share - 1.0) if share else None,
            )
        )

    def _check_stop(self) -> bool:
        if self._should_stop is not None:
            self.stopped = self.stopped or self._should_stop()
        return self.stopped
