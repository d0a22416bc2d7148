# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Search for grasps: kinematic approach of the members, then closing by statics.

The search runs in rounds. Each round has several candidates. A candidate starts from a seed, which
consists of grasping members, their directions toward the object, and a nominal posture for the
remaining degrees of freedom. By kinematics, each candidate reaches an open grip or is rejected;
then the grip is closed by statics. The first round has the most promising seeds; the following
rounds have random postures.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor, wait
from dataclasses import dataclass, field, replace
import time

from isotruss_ros.core.chance.uncertainty import Uncertainty
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.argument_kinds import check_kinds
from isotruss_ros.core.numerics.arrays import check_count
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.planning.approach import Closing, evaluate_state
from isotruss_ros.core.planning.grasp_candidate import judge_candidate, Judgement
from isotruss_ros.core.planning.grasp_plan import GraspPlan, PlannedGrasp, Progress
from isotruss_ros.core.planning.rank_by_chance import rank_by_chance
from isotruss_ros.core.planning.requirements import GraspRequirements
from isotruss_ros.core.planning.seeds import find_seeds, required_members
from isotruss_ros.core.planning.violations import SearchTally, Violation
from isotruss_ros.core.safety.margins import object_distances
from isotruss_ros.core.statics.structure import structure_of
import numpy as np

#: Largest difference of roller positions at which two grasps by the same members count as equal,
#: in mean member lengths [-].
EQUALITY_SHARE = 0.02
#: Largest overlap of the object with the robot at the start, in tube diameters [-]: 2 mm with the
#: tubes of the presets, for an object that touches a tube in a measured pose. Approaches never
#: increase it.
MAX_TOUCH = 0.02
#: Period of the check for a stop while an executor computes [s].
POLL_INTERVAL = 0.05


@check_kinds
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
    uncertainty: Uncertainty | None = None,
) -> GraspPlan:
    """
    Return grasps of a free object inside a loop of the robot, with paths to the grasps.

    Candidates are all pairs and triples of members around the object, unless the requirements name
    a module or members. Grasps are ranked by slip margin, unless the requirements name another
    criterion. The first round has the most promising candidates; further rounds start from random
    postures. The plan depends on `seed`, but not on the number of cores.

    :param config: configuration of the robot.
    :param body: the object. If it has a coefficient of friction, this replaces the one in the
        requirements.
    :param requirements: requirements of a grasp; None: `GraspRequirements()`.
    :param seed: seed of the random number generator.
    :param executor: executor that computes the candidates, for example a process pool or that of a
        Dask client; None: this process computes them.
    :param on_progress: callback at the start of each round and after each candidate.
    :param should_stop: function that is called before each candidate, and with an executor every
        `POLL_INTERVAL`. If it returns true, the search stops with the grasps found so far.
    :param thorough: True to compute all candidates of a round; otherwise a round ends when
        `requirements.count` grasps are found.
    :param max_rounds: largest number of rounds. No further round begins when that many grasps are
        found.
    :param uncertainty: uncertainty of robot and object. Then grasps are ranked by the chance that
        the object is held, also along the path `carry` of the requirements. The search uses the
        chance to first order. The grasps found are ranked by samples, unless there are more than
        twelve, or a path or an external wrench is required.
    :raises GraspError: the robot has no such module or members, or an integer is invalid.
    :raises StructureError: the robot cannot be analysed.
    """
    needs = requirements or GraspRequirements()
    required_members(config.robot, needs)  # names are checked here, once
    if body.friction is not None:
        needs = replace(needs, friction=body.friction)
    seed = check_count(seed, 'seed', GraspError)
    max_rounds = check_count(max_rounds, 'max_rounds', GraspError)
    # A copy without cached results, as another process has it.
    config = Configuration(config.robot, config.roller_positions, config.points)
    structure_of(config)  # contradictory stiffness laws are reported here, once

    search = _Search(
        config, needs, executor, on_progress or (lambda _: None), should_stop or (lambda: False)
    )
    gap = float(object_distances(config, body).min())
    bound = -MAX_TOUCH * config.robot.description.tube_diameter
    if gap < bound:  # there is no path to a grasp
        search.tally.record(Violation('free', gap, bound))
    with search.tally.recording():
        evaluate_state(config, body, needs).check_obstacles(0.0)
    if search.tally.closest is not None:
        max_rounds = 0
    for number in range(max_rounds):
        with search.tally.recording():
            seeds = find_seeds(config, body, needs, seed, number)
            closings = [replace(closing, uncertainty=uncertainty) for closing in seeds]
            search.judge(closings, thorough)
        if search.stopped or len(search.best()) >= needs.count:
            break
    best, tally = tuple(search.best()), search.tally
    is_moved = bool(needs.carry) or any(needs.external_wrench)
    if uncertainty is not None and not is_moved and not search.stopped:
        best = rank_by_chance(best, needs.friction, uncertainty)
    closest = None if best else tally.closest
    evaluations, duration = tally.evaluations + tally.analyses, time.perf_counter() - search.began
    return GraspPlan(best, not search.stopped, closest, evaluations, tally.analyses, duration)


@dataclass(eq=False)
class _Search:
    """State of a grasp search; its first fields are the parameters of `plan_grasps`."""

    config: Configuration
    needs: GraspRequirements
    executor: Executor | None
    on_progress: Callable[[Progress], None]
    should_stop: Callable[[], bool]
    began: float = field(default_factory=time.perf_counter)
    grasps: list[PlannedGrasp] = field(default_factory=list)
    judged: int = 0  #: number of judged candidates
    begun: int = 0  #: number of candidates of all rounds begun so far
    stopped: bool = False
    tally: SearchTally = field(default_factory=SearchTally)

    def judge(self, closings: list[Closing], thorough: bool) -> None:
        """Add the grasps of closing motions; stop at the required number, unless `thorough`."""
        self.begun += len(closings)
        self._report()
        for grasp, tally in self._judge_each(closings):
            self.judged += 1
            self.tally.add(tally)
            if grasp is not None:
                # The result refers to the caller's robot, not to a copy from another process.
                points = grasp.config.points
                config = Configuration(self.config.robot, grasp.roller_positions, points)
                self.grasps.append(replace(grasp, config=config))
            self._report()
            if not thorough and len(self.best()) >= self.needs.count:
                return

    def best(self) -> list[PlannedGrasp]:
        """Return the distinct grasps found so far, best first."""
        tolerance = EQUALITY_SHARE * self.config.robot.home.member_lengths.mean()
        distinct: list[PlannedGrasp] = []
        for grasp in sorted(self.grasps, key=lambda grasp: -grasp.score):
            if not any(
                grasp.members == better.members
                and np.abs(grasp.path[-1] - better.path[-1]).max() < tolerance
                for better in distinct
            ):
                distinct.append(grasp)
        return distinct[: self.needs.count]

    def _judge_each(self, closings: list[Closing]) -> Iterator[Judgement]:
        """Yield the judgements of closing motions in their order, until the search is stopped."""
        if self.executor is None:
            for closing in closings:
                self.stopped = self.should_stop()
                if self.stopped:
                    return
                yield judge_candidate(self.config, closing)
            return
        futures = [self.executor.submit(judge_candidate, self.config, item) for item in closings]
        try:
            for future in futures:
                while not wait([future], POLL_INTERVAL).done:
                    self.stopped = self.should_stop()
                    if self.stopped:
                        return
                yield future.result()
        finally:
            for future in futures:
                future.cancel()

    def _report(self) -> None:
        """Pass the progress of the search to its callback."""
        share, spent = self.judged / self.begun, time.perf_counter() - self.began
        time_left = spent * (1.0 / share - 1.0) if share else None
        evaluations = self.tally.evaluations + self.tally.analyses
        best_score = max((grasp.score for grasp in self.grasps), default=None)
        self.on_progress(Progress(evaluations, len(self.best()), best_score, share, time_left))
