# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""One grasp candidate, from the open grip to the grasp; it can be sent to other processes."""

from __future__ import annotations

from dataclasses import dataclass
import functools
import pickle

from isotruss_ros.core.errors import IsotrussError
from isotruss_ros.core.grasping.analysis import GraspAnalysis
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.model.convex_object import ConvexObject

Cylinder = type(None)
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.planning.approach import Approach
from isotruss_ros.core.planning.closed_grip import ClosedGrip
from isotruss_ros.core.planning.closing_in_place import ClosingInPlace
from isotruss_ros.core.planning.closing_qp import Closing
from isotruss_ros.core.planning.force_bounds import GraspLoads
from isotruss_ros.core.planning.grasp_plan import Violation
from isotruss_ros.core.planning.requirements import GraspRequirements
from isotruss_ros.core.planning.squeeze import Squeeze
from isotruss_ros.core.safety.margins import shape_margins
import numpy as np


@dataclass(frozen=True, eq=False)
class GraspCandidate:
    """
    An open grip that is a candidate for a grasp; nothing in it is tied to a process.

    :ivar robot: the pickled description of the robot.
    :ivar positions: (r,) roller positions of the open grip [m].
    :ivar points: (n,) its nodes [m].
    :ivar closing: what closes.
    :ivar requirements: what the grasp is to fulfil.
    """

    robot: bytes
    positions: Array
    points: Points
    closing: Closing
    requirements: GraspRequirements


@dataclass(frozen=True, eq=False)
class Squeezed:
    """
    What became of a candidate.

    :ivar positions: (k, r) roller positions from the touch to the grasp [m]; none if it is none.
    :ivar points: (n,) nodes in the grasp [m].
    :ivar body: the object in the grasp.
    :ivar analysis: of the grasp; None if it is none.
    :ivar loads: of the grasp; None if it is none.
    :ivar squeeze: mean normal force of the grasping members [N].
    :ivar slip_margin: see `PlannedGrasp` [N].
    :ivar rigidity: the least from the touch to the grasp.
    :ivar violation: the requirement that it violates; None if it is a grasp.
    :ivar evaluations: configurations that were computed.
    :ivar analysed: analyses.
    """

    positions: Array
    points: Points
    body: Cylinder | ConvexObject
    analysis: GraspAnalysis | None
    loads: GraspLoads | None
    squeeze: float
    slip_margin: float
    rigidity: float
    violation: Violation | None
    evaluations: int
    analysed: int


def make_grasp_candidate(approached: Approach, requirements: GraspRequirements) -> GraspCandidate:
    """
    Turn an open grip into a candidate that can be sent to another process.

    :param approached: the open grip.
    :param requirements: what the grasp must fulfil.
    """
    config = approached.path[-1]
    description = pickle.dumps(config.robot.description)
    return GraspCandidate(
        description, config.roller_positions, config.points, approached.closing, requirements
    )


def squeeze_candidate(candidate: GraspCandidate) -> Squeezed:
    """
    Find how hard a candidate must press to be a grasp, in any process.

    Two members close in place on a free object, and so do any members of a grip. One that the
    ground holds, and three members around a cylinder, are pressed on it as it lies.

    :param candidate: the open grip.
    """
    robot = _robot(candidate.robot)
    opened = Configuration(robot, candidate.positions, candidate.points)
    closing = candidate.closing
    pair = len(closing.members) == 2 and candidate.requirements.object_is_free
    kind = ClosingInPlace if pair or closing.module is None else Squeeze
    search: ClosingInPlace | Squeeze = kind(opened, closing, candidate.requirements)
    found: ClosedGrip | None = None
    try:
        found = search.close()
    except IsotrussError as error:
        # A candidate that cannot be computed is none; what was found out before still counts.
        search.closest_violation = search.closest_violation or Violation(
            str(error), 0.0, 0.0, 100.0
        )
    if found is None:
        nothing = np.empty((0, len(candidate.positions)))
        violation = search.closest_violation or Violation('path', 0.0, 1.0, 60.0)
        return Squeezed(
            nothing,
            opened.points,
            candidate.closing.body,
            None,
            None,
            0.0,
            0.0,
            0.0,
            violation,
            search.evaluations,
            search.analyses,
        )
    return Squeezed(
        np.array([config.roller_positions for config in found.path]),
        found.path[-1].points,
        found.body,
        found.analysis,
        found.loads,
        found.squeeze,
        found.slip_margin,
        min(shape_margins(config).rigidity for config in found.path),
        None,
        search.evaluations,
        search.analyses,
    )


@functools.lru_cache(maxsize=4)
def _robot(description: bytes) -> Robot:
    return Robot(pickle.loads(description))
