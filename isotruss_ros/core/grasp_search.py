"""
The search for grasps: first where the grip must be, then how hard it must squeeze.

Each round has a number of branches: a module, how far it opens, which sides touch, and toward
which posture the robot is drawn where the task leaves it free. Kinematics brings every branch to
an open grip, or shows that there is none; statics squeezes them, nearest first. The first round
knows what a good grasp looks like; the others draw postures at random.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, wait
import time

from isotruss_ros.core.approach import Approach, approach
from isotruss_ros.core.branches import branches, MAX_ROUNDS
from isotruss_ros.core.candidate import make_candidate, squeeze_candidate, Squeezed
from isotruss_ros.core.closing import Closing
from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.errors import ConfigurationError, GraspError, SolverError
from isotruss_ros.core.grasp import Grasp
from isotruss_ros.core.grasp_analysis import Cylinder
from isotruss_ros.core.grasp_plan import GraspPlan, Miss, PlannedGrasp, Progress
from isotruss_ros.core.object_gaps import object_gaps
from isotruss_ros.core.requirements import GraspRequirements
from isotruss_ros.core.shape_margins import shape_margins
from isotruss_ros.core.squeeze import SPACINGS
import numpy as np

#: Grasps of the same members are one when no roller differs by more than this share of a member.
SAME_SHARE = 0.02
#: Spacing of the contact points of the analysis that goes with a grasp [m].
REPORTED = 0.005
#: How often a caller who wants to stop is heard while other processes work [s].
LISTENING = 0.05


def plan_grasps(
    config: Configuration,
    cylinder: Cylinder,
    requirements: GraspRequirements | None = None,
    seed: int = 0,
    executor: Executor | None = None,
    on_progress: Callable[[Progress], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
    thorough: bool = True,
) -> GraspPlan:
    """
    Find grasps of an object that lies free inside a loop of the robot, and the way to them.

    The same seed gives the same answer on one core or many: candidates are judged in their order,
    wherever they are computed.

    :param config: where the robot is.
    :param cylinder: the object, where it is.
    :param requirements: what a grasp must fulfil; those of `GraspRequirements()` if None.
    :param seed: of the postures drawn at random.
    :param executor: where candidates are squeezed: a process pool, or that of a Dask client; in
        this process if None.
    :param on_progress: called when the open grips of a round are known, and after every candidate.
    :param should_stop: asked before every step toward an open grip, after every candidate and,
        with an executor, all 50 ms; a plan that was stopped has what was found until then.
    :param thorough: whether all candidates of a round are looked at before the best are chosen,
        or only so many as it takes.
    :raises GraspError: the robot has no such module, or the seed is not usable.
    :raises StructureError: the robot cannot be analysed.
    """
    needs = requirements or GraspRequirements()
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or seed < 0:
        raise GraspError(f'seed {seed!r}: must be an integer, not negative')
    search = _Search(config, cylinder, needs, on_progress or _ignore, should_stop or _never)
    config.structure  # contradictory stiffness laws are said here, once  # noqa: B018
    for number in range(MAX_ROUNDS if search.is_free() else 0):
        opened = search.approach(branches(config, cylinder, needs, int(seed), number))
        for reached, squeezed in search.squeeze(opened, executor):
            search.judge(reached, squeezed)
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
        cylinder: Cylinder,
        needs: GraspRequirements,
        on_progress: Callable[[Progress], None],
        should_stop: Callable[[], bool],
    ) -> None:
        self._config, self._cylinder, self._needs = config, cylinder, needs
        self._on_progress, self._should_stop = on_progress, should_stop
        self._began = time.perf_counter()
        self._grasps: list[PlannedGrasp] = []
        self._nearest: Miss | None = None
        self._evaluations = self._analyses = self._judged = self._known = self._rounds = 0
        self.stopped = False

    def is_free(self) -> bool:
        """Tell whether nothing touches the object yet: there is no way to it otherwise."""
        gaps = object_gaps(self._config, self._cylinder)
        least = float(min(gaps.members.min(), gaps.modules.min()))
        if least < 0.0:
            self._note(Miss('free', least, 0.0, 2000.0))
        return least >= 0.0

    def approach(self, closings: Sequence[Closing]) -> list[Approach]:
        """Bring the branches of a round to open grips; return those that got there."""
        self._rounds += 1
        opened = []
        for closing in closings:
            if self._hear():
                break
            try:
                reached = approach(self._config, closing, self._hear)
            except (ConfigurationError, SolverError) as error:
                # A branch that cannot be computed is none; the others are.
                self._note(Miss(str(error), 0.0, 0.0, 100.0))
                continue
            self._evaluations += reached.looked_at
            if reached.missed is None:
                opened.append(reached)
                continue
            name, value = reached.missed
            self._note(Miss(name, float(value), closing.bound(name), 100.0))
        if not closings:
            self._note(Miss('enclosed', 0.0, 1.0, 1000.0))
        self._known += len(opened)
        self._on_progress(self.progress())
        return sorted(opened, key=lambda reached: reached.travel)

    def squeeze(
        self, opened: Sequence[Approach], executor: Executor | None
    ) -> Iterator[tuple[Approach, Squeezed]]:
        """Squeeze open grips; give them in their order."""
        candidates = [make_candidate(reached, self._needs) for reached in opened]
        if executor is None:
            for reached, candidate in zip(opened, candidates, strict=True):
                if self._hear():
                    return
                yield reached, squeeze_candidate(candidate)
            return
        futures = [executor.submit(squeeze_candidate, candidate) for candidate in candidates]
        try:
            for reached, future in zip(opened, futures, strict=True):
                while not wait([future], LISTENING).done:
                    if self._hear():
                        return
                yield reached, future.result()
        finally:
            for future in futures:
                future.cancel()

    def judge(self, reached: Approach, squeezed: Squeezed) -> None:
        """Take over what became of a candidate."""
        self._judged += 1
        self._evaluations += squeezed.looked_at + squeezed.analysed
        self._analyses += squeezed.analysed
        if squeezed.miss is not None:
            self._note(squeezed.miss)
        else:
            self._grasps.append(self._planned(reached, squeezed))
        self._on_progress(self.progress())

    def best(self) -> list[PlannedGrasp]:
        """Return the distinct grasps, best first."""
        same = SAME_SHARE * float(self._config.robot.home.member_lengths.mean())
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
        """Return how far the search is."""
        share = self._judged / self._known if self._known else 0.0
        spent = time.perf_counter() - self._began
        best = max((grasp.score for grasp in self._grasps), default=None)
        left = spent * (1.0 / share - 1.0) if share else None
        return Progress(self._evaluations, len(self.best()), best, share, left)

    def plan(self) -> GraspPlan:
        """Return what was found."""
        best = tuple(self.best())
        return GraspPlan(
            best,
            not self.stopped,
            None if best else self._nearest,
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
        coarse = squeezed.analyses[SPACINGS.index(REPORTED)]
        return PlannedGrasp(
            grasp=Grasp(
                robot.module_names[closing.module], self._cylinder.center, self._cylinder.diameter
            ),
            members=tuple(coarse.contact_lengths),
            config=Configuration(robot, path[-1], squeezed.points),
            analysis=coarse,
            score=squeezed.score(self._needs, travel),
            closure_margin=min(one.closure_margin for one in squeezed.analyses),
            required_friction=max(one.required_friction for one in squeezed.analyses),
            max_contact_force=max(max(one.contact_forces.values()) for one in squeezed.analyses),
            total_force=max(float(one.normal_forces.sum()) for one in squeezed.analyses),
            travel=travel,
            rigidity=min(rigid, squeezed.rigidity),
            path=path,
            touch=len(opened),
        )

    def _hear(self) -> bool:
        self.stopped = self.stopped or self._should_stop()
        return self.stopped

    def _note(self, miss: Miss) -> None:
        if self._nearest is None or miss.distance < self._nearest.distance:
            self._nearest = miss


def _ignore(_progress: Progress) -> None:
    pass


def _never() -> bool:
    return False
