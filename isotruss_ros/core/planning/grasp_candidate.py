# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""One candidate for a grasp, from its seed to the planned grasp, in this process or another."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
import functools
import math
import pickle
from typing import NamedTuple

from isotruss_ros.core.errors import ConfigurationError, GraspError, IsotrussError, SolverError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.planning.approach import approach
from isotruss_ros.core.planning.closed_grip import ClosedGrip
from isotruss_ros.core.planning.closing import Closing
from isotruss_ros.core.planning.closing_in_place import close_in_place
from isotruss_ros.core.planning.closing_on_ground import close_on_ground
from isotruss_ros.core.planning.closing_step import press
from isotruss_ros.core.planning.foresee_path import foresee_grip
from isotruss_ros.core.planning.grasp_plan import PlannedGrasp, SearchTally
from isotruss_ros.core.planning.requirements import GraspRequirements, rate_grasp
from isotruss_ros.core.safety.margins import shape_margins
import numpy as np


@dataclass(frozen=True, eq=False)
class GraspCandidate:
    """
    A seed, and what a grasp needs; nothing in it is tied to a process.

    :ivar robot: the pickled description of the robot.
    :ivar positions: (r,) roller positions where the path begins [m].
    :ivar points: (n,) the nodes there [m].
    :ivar closing: what closes.
    :ivar requirements: what the grasp is to fulfil.
    """

    robot: bytes
    positions: Array
    points: Points
    closing: Closing
    requirements: GraspRequirements


class Judged(NamedTuple):
    """
    What became of a candidate.

    :ivar grasp: the grasp; None if there is none.
    :ivar tally: what was looked at, with the violation if there is no grasp.
    """

    grasp: PlannedGrasp | None
    tally: SearchTally


def make_grasp_candidate(
    config: Configuration, closing: Closing, requirements: GraspRequirements
) -> GraspCandidate:
    """
    Return a candidate that can be sent to another process.

    :param config: configuration of the robot.
    :param closing: the seed.
    :param requirements: what the grasp must fulfil.
    """
    description = pickle.dumps(config.robot.description)
    positions, points = config.roller_positions, config.points
    return GraspCandidate(description, positions, points, closing, requirements)


def judge_candidate(
    candidate: GraspCandidate, should_stop: Callable[[], bool] | None = None
) -> Judged:
    """
    Bring a candidate to the object and close it there, in any process.

    :param candidate: the seed.
    :param should_stop: called before every step toward the open grip.
    """
    start = Configuration(_robot(candidate.robot), candidate.positions, candidate.points)
    closing, needs, tally, grasp = candidate.closing, candidate.requirements, SearchTally(), None
    try:
        opened, unmet = approach(start, closing, tally, should_stop)
        closed = None
        if unmet is None:
            closed = close_grip(opened[-1], closing, needs, tally)
        else:
            tally.record(*unmet, closing.bound(unmet[0]), 100.0)
    except IsotrussError as error:
        # A candidate that cannot be computed is none; what was found out before still counts.
        tally.record(str(error), 0.0, 0.0, 100.0)
    else:
        if closed is not None:
            grasp = _planned(closing, needs, opened, *closed)
        if grasp is not None and needs.carry:
            grasp = _carrying(grasp, needs, tally)
    return Judged(grasp, tally)


def close_grip(
    opened: Configuration, closing: Closing, needs: GraspRequirements, tally: SearchTally
) -> tuple[list[Configuration], ClosedGrip] | None:
    """
    Return the path from the touch to the best grip that fulfils the requirements, and that grip.

    The members press harder and harder, until the grip gets no better or a bound is reached.

    :param opened: configuration in which the members are close to the object.
    :param closing: what closes.
    :param needs: what the grasp must fulfil.
    :param tally: of the search.
    :return: None where there is none; then the tally has the closest violation.
    :raises SolverError: a quadratic program, or the contact, was not solved.
    :raises StructureError: see `structure_of`.
    """
    # A nominal posture would keep the gaps from their targets, by a little.
    closing = replace(closing, nominal_posture=None, facing=None)
    touch = press(opened, closing, np.zeros(len(closing.members)), tally)
    if touch is None:
        return None
    rise = close_in_place if needs.object_is_free else close_on_ground
    path, best, best_score = [touch], None, -math.inf
    for grip in rise(touch, closing, needs, tally):
        path.append(grip.config)
        if grip.slip_margin is None:
            continue
        # The path as far as here is shorter than all of it.
        total = grip.loads.max_total_force
        score = rate_grasp(needs, grip.analysis, total, grip.slip_margin, -grip.squeeze)
        if score <= best_score:
            break
        best, best_score = (path[:], grip), score
    return best


def _planned(
    closing: Closing,
    needs: GraspRequirements,
    opened: tuple[Configuration, ...],
    pressed: list[Configuration],
    closed: ClosedGrip,
) -> PlannedGrasp:
    """Return the grasp at the end of the path to an open grip and of that from the touch on."""
    configs, analysis, loads = (*opened, *pressed), closed.analysis, closed.loads
    path = np.array([config.roller_positions for config in configs])
    travel = float(np.abs(np.diff(path, axis=0)).sum(axis=0).max())
    total, margin = loads.max_total_force, closed.slip_margin
    names = tuple(closed.config.robot.member_names[i] for i in closing.members)
    return PlannedGrasp(
        grip=Grip(names, closed.body, needs.friction),
        members=tuple(analysis.contact_lengths),
        config=closed.config,
        analysis=analysis,
        score=rate_grasp(needs, analysis, total, margin, -travel),
        squeeze=closed.squeeze,
        slip_margin=margin,
        closure_margin=analysis.closure_margin,
        required_friction=analysis.required_friction,
        max_contact_force=loads.max_contact_force,
        total_force=total,
        utilisation=loads.max_utilisation,
        travel=travel,
        rigidity=min(shape_margins(config).rigidity for config in configs),
        path=path,
        touch=len(opened),
    )


def _carrying(
    grasp: PlannedGrasp, needs: GraspRequirements, tally: SearchTally
) -> PlannedGrasp | None:
    """Return a grasp if it carries the object along its path; None if it slips on it."""
    tally.closest = None
    try:
        found = foresee_grip(grasp.config, grasp.grip.body, needs.friction, np.array(needs.carry))
    except (ConfigurationError, GraspError, SolverError) as error:
        tally.record(str(error), 0.0, 1.0, 1.0)
        return None
    if found is not None and not found.why:
        return grasp
    share = 0.0 if found is None else found.share
    tally.record('carry', share, 1.0, 1.0 - share)
    return None


@functools.lru_cache(maxsize=4)
def _robot(description: bytes) -> Robot:
    return Robot(pickle.loads(description))
