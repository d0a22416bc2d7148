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
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.planning.approach import Approach
from isotruss_ros.core.planning.closed_grip import ClosedGrip
from isotruss_ros.core.planning.closing import Closing
from isotruss_ros.core.planning.closing_in_place import ClosingInPlace
from isotruss_ros.core.planning.grasp_plan import Violation
from isotruss_ros.core.planning.requirements import GraspRequirements
from isotruss_ros.core.planning.squeeze import Squeeze


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

    :ivar grip: that holds the object; None if it is no grasp.
    :ivar violation: the requirement that it violates; None if it is a grasp.
    :ivar evaluations: configurations that were computed.
    :ivar analyses: how many were analysed.
    """

    grip: ClosedGrip | None
    violation: Violation | None
    evaluations: int
    analyses: int


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

    Members close in place on a free object; on one that the ground holds they press as it lies.

    :param candidate: the open grip.
    """
    opened = Configuration(_robot(candidate.robot), candidate.positions, candidate.points)
    kind = ClosingInPlace if candidate.requirements.object_is_free else Squeeze
    search = kind(opened, candidate.closing, candidate.requirements)
    try:
        grip = search.close()
    except IsotrussError as error:
        # A candidate that cannot be computed is none; what was found out before still counts.
        grip, failed = None, Violation(str(error), 0.0, 0.0, 100.0)
    else:
        failed = Violation('path', 0.0, 1.0, 60.0)
    violation = None if grip is not None else search.closest_violation or failed
    return Squeezed(grip, violation, search.evaluations, search.analyses)


@functools.lru_cache(maxsize=4)
def _robot(description: bytes) -> Robot:
    return Robot(pickle.loads(description))
