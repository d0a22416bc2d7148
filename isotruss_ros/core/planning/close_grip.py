# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The second step of the search: how hard the members of an open grip press, and the path there."""

from __future__ import annotations

from dataclasses import replace
import math

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.planning.closed_grip import ClosedGrip
from isotruss_ros.core.planning.closing import Closing
from isotruss_ros.core.planning.closing_in_place import close_in_place
from isotruss_ros.core.planning.closing_on_ground import close_on_ground
from isotruss_ros.core.planning.closing_step import press
from isotruss_ros.core.planning.grasp_plan import SearchTally
from isotruss_ros.core.planning.requirements import GraspRequirements, rate_grasp
import numpy as np


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
