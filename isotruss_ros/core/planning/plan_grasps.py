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

Each round has a number of seeds: the grasping members, the directions in which they are to face
the object, and the nominal posture that the remaining freedom is drawn to. Kinematics brings every
seed to an open grip, or shows that there is none; statics closes it. The first round has the seeds
that are usually good; the others have random postures.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.planning.grasp_plan import GraspPlan, Progress
from isotruss_ros.core.planning.grasp_search import GraspSearch
from isotruss_ros.core.planning.requirements import GraspRequirements
from isotruss_ros.core.planning.seeds import explain_no_seeds, find_seeds, required_members
from isotruss_ros.core.planning.settings import DEFAULT, SearchSettings
from isotruss_ros.core.safety.margins import object_distances
from isotruss_ros.core.statics.structure import structure_of
import numpy as np

#: An object that overlaps the robot by less than this does not yet touch it [m].
OVERLAP = 1e-6


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
    settings: SearchSettings = DEFAULT,
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
    :param should_stop: called after every candidate, before every step toward an open grip and,
        with an executor, at the poll interval instead; a plan that was stopped has the grasps so
        far.
    :param thorough: whether all candidates of a round are computed before the best are chosen,
        or only until there are enough grasps.
    :param settings: of the search.
    :raises GraspError: the robot has no such module or members, or the seed is not usable.
    :raises StructureError: the robot cannot be analysed.
    """
    needs = requirements or GraspRequirements()
    required_members(config.robot, needs)  # names are checked here, once
    if body.friction is not None:
        needs = replace(needs, friction=body.friction)
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or seed < 0:
        raise GraspError(f'seed {seed!r}: must be an integer, not negative')
    search = GraspSearch(config, needs, on_progress or _ignore, should_stop or _never, settings)
    structure_of(config)  # contradictory stiffness laws are reported here, once
    gap = float(object_distances(config, body).min())
    if gap < -OVERLAP:  # there is no path to a grasp
        search.tally.record('free', gap, 0.0, 2000.0)
        return search.plan()
    for number in range(settings.max_rounds):
        seeds = find_seeds(config, body, needs, int(seed), number, settings)
        if not seeds:
            search.tally.record(*explain_no_seeds(config, body, needs))
        search.judge(seeds, executor, thorough)
        if search.stopped or len(search.best()) >= needs.count:
            break
    return search.plan()


def _ignore(_progress: Progress) -> None:
    pass


def _never() -> bool:
    return False
